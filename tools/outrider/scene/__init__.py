"""Data of a 3D view: takes scenarios, states and commands, gives scenes, snapshots and changes."""
