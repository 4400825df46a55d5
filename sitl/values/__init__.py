"""Shared values: they take messages and coordinates and give set-points, frames and attitudes."""
