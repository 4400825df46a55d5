"""Collision avoidance: takes the state, the aim and the obstacles, gives a plan (by field or certified)."""
