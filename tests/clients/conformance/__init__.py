"""Assertions of other people's test suites, on the vehicles of ``outrider sitl`` under the simulated clock.

Only what is asserted is taken over, with its figures; each test names the file and the test that assert it.
docs/sitl.md has the table of results.
"""
