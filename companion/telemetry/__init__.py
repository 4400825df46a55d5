"""Messages of the companion's state for neighbours and ground, and filters of received messages."""
