"""Pytest plugin: takes scenarios and logs, gives flights and set-points with assertions to tests.

The steps are ``plugin`` → ``flown``, ``scenes`` → ``setpoints``, ``golden`` → assertions with readable
messages. docs/testing.md has an example to copy.
"""
