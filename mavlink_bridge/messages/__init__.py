"""Values that outrider exchanges: one frozen tuple per MAVLink message, SI units, the message's own frame.

Unless a class says otherwise, angles are radians, distances metres, latitudes and longitudes degrees
(float64, so that the degE7 step of 1.1 cm is kept), times integer µs. Positions stay local NED or geodetic as
in the message; only ``frames`` converts them. ``None`` stands for a field that the sender marked unknown,
except where the message's own marker is NaN. The values are tuples rather than dataclasses because they are
created thousands of times a second, and a tuple costs a third as much.

A message is declared in one place: its class, with the decorator ``declaration.message``, in the module of
its subject.
"""

from __future__ import annotations

from mavlink_bridge.messages.cameras import *
from mavlink_bridge.messages.commands import *
from mavlink_bridge.messages.components import *
from mavlink_bridge.messages.declaration import BY_ID, BY_TYPE, Converter, Message
from mavlink_bridge.messages.links import *
from mavlink_bridge.messages.logs import *
from mavlink_bridge.messages.missions import *
from mavlink_bridge.messages.motion import *
from mavlink_bridge.messages.origin import *
from mavlink_bridge.messages.outputs import *
from mavlink_bridge.messages.parameters import *
from mavlink_bridge.messages.sensors import *
from mavlink_bridge.messages.setpoints import *
from mavlink_bridge.messages.simulation import *
from mavlink_bridge.messages.source import Source, Vector
from mavlink_bridge.messages.status import *
from mavlink_bridge.messages.surroundings import *

__all__ = ["BY_ID", "BY_TYPE", "Converter", "Message", "Source", "Vector"]
__all__ += [kind.__name__ for kind in BY_TYPE]
