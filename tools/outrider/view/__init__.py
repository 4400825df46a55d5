"""The live view: moments of a flight → bounded line → stage in the browser; wishes come back the same way.

``scene`` and ``moment`` are the picture's data; ``lockstep``, ``realtime``, ``listener`` and ``player`` make
them; ``stage`` and ``panel`` draw them with viser. Whoever flies never waits for who looks on.
"""
