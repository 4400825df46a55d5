"""The pytest plugin: flights and logs in tests of whoever has outrider installed.

    plugin → flown, replayed → setpoints, golden, modes → assertions in words

docs/testing.md has an example to copy.
"""
