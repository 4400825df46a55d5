"""Turns received messages into dated, gated and filtered states of the target and of other vehicles."""
