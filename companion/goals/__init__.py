"""Goals of a vehicle: takes the world view and the phase of the flight, gives the aim and yaw of a plan."""
