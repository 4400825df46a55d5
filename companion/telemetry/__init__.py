"""Turns the companion's state into messages for neighbours and ground, and filters received messages."""
