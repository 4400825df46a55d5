"""Everything between bytes and values: wire, units, time, and the only sockets. Knows no node.

::

    bytes → framing (start, length, checksum) → codec (header filter, signing, converters: units) → messages
    messages → codec (converters: units, range) → framing (header, sequence, checksum) → signing → bytes

    geodetic, local NED ⇄ frames ⇄ fleet-local ENU          committed plan ⇄ plan_wire ⇄ 128 bytes of TUNNEL

    runtime, simulated time: every due node receives, then every due node steps, then everything is sent
                 node → [Datagram] → ether (channel: delay, loss, partitions) → [Datagram] → node
                                └→ taps → tlog        slot, node_clock: when a node's own clock says it is due

    realtime, wall clock:  links → inbox (a thread) → [Datagram] → node, at its deadlines → [Datagram] → links
                           deadlines, priority, garbage: on time;  histogram: how late all the same

A node (``node``) is a sans-I/O participant; ``messages`` are the values it exchanges; ``errors`` it raises.
"""
