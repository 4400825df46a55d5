"""Processes of this machine: gives forked children, memory that they share, and the number of cores."""
