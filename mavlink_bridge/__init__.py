"""Conversion between MAVLink bytes and values: wire format, units, time, links and the two node loops.

The package is independent of the nodes. No other package opens sockets for them.

::

    bytes → framing (start, length, checksum) → codec (header filter, signing, converters: units) → messages
    messages → codec (converters: units, range) → framing (header, sequence, checksum) → signing → bytes

    geodetic, local NED ⇄ frames ⇄ fleet-local ENU          committed plan ⇄ wire.plan ⇄ 128 bytes of TUNNEL

    lockstep, simulated time: every due node receives, then every due node steps, then everything is sent
        node → [Datagram] → simulated network (channel: delay, loss, partitions) → [Datagram] → node
                       └→ taps → tlog      schedule, node_clock: when a node is due on its own clock

    realtime, wall clock:  links → inbox (a thread) → [Datagram] → node, at its deadlines → [Datagram] → links
                           deadlines, priority, garbage: punctuality;  histogram: measured lateness

A node (``node``) is a sans-I/O participant. ``messages`` holds the values that nodes exchange; ``errors``
holds the exceptions of the package.
"""
