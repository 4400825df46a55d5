"""Supervision of a companion: inhibition of the take-off, detection of duplicate ids, hold on exit."""
