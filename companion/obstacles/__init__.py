"""Turns configured obstacles and messages about neighbours, objects and traffic into obstacles to avoid."""
