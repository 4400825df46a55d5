"""Loops that run nodes over a simulated network in lock-step, or over real links in real time."""
