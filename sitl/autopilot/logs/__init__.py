"""Logs of flights: recorded while armed, in the firmware's own format, listed and sent on request."""
