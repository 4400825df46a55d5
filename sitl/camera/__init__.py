"""Simulated camera: it takes true and estimated motion, and gives the messages of a camera and its gimbal."""
