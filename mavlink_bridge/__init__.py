"""Everything between bytes and values: wire, units, time. Knows no node, opens no socket.

::

    bytes → framing (start, length, checksum) → codec (filter by header, converters: units) → messages
    messages → codec (converters: units, range) → framing (header, sequence, checksum) → bytes

    geodetic, local NED ⇄ frames ⇄ fleet-local ENU          committed plan ⇄ plan_wire ⇄ 128 bytes of TUNNEL

    clock → runtime: every due node receives, then every due node steps, then everything is sent
                 node → [Datagram] → ether (delay, loss, partitions) → [Datagram] → node
                                └→ taps → tlog

A node (``node``) is a sans-I/O participant; ``messages`` are the values it exchanges; ``errors`` it raises.
"""
