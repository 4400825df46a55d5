"""Reader and writer of tlog files: MAVLink frames with their times."""
