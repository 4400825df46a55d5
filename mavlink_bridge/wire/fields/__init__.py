"""Conversion of each message's fields: tuples in MAVLink's wire order ↔ the SI values of ``messages``.

degE7 ↔ degrees (float64), mm, cm/s, mV, % ↔ m, m/s, V, 0…1; cdeg ↔ rad; ms ↔ µs (the rest is lost); markers
of *unknown* ↔ None. ``name(source, fields)`` decodes, and returns None if a field is invalid;
``name_fields(message)`` encodes, or raises EncodeError.
"""
