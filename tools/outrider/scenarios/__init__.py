"""Scenario and companion files: takes YAML, gives typed, checked, frozen configurations."""
