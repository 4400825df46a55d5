"""Benchmarks of ``outrider bench``: take a number of rounds, give CPU times of each part."""
