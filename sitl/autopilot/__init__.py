"""The autopilot's logic: it takes MAVLink messages and estimates and gives modes, references and answers."""
