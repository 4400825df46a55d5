"""Clocks that give the time in µs: simulated, real, skewed, or estimated from another machine's stamps."""
