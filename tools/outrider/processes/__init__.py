"""Processes of this machine: forked children, memory that they share, and the number of cores."""
