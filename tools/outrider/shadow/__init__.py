"""Shadow runs of a log: takes a log and settings, gives the set-points that a companion would have sent."""
