"""Simulated flight: takes a scenario and a seed, gives its nodes, their flight and its outcome."""
