"""The last word to the autopilot when its companion ends: stay where you are.

An autopilot that was just told positions and velocities flies on along them for its time-out. So whoever
sees a companion end asks for the mode in which the autopilot holds its place by itself; but only where our
set-points steered last: whoever else has the vehicle keeps it.
"""

from __future__ import annotations

from collections.abc import Sequence

from companion.autopilots import Profile
from companion.autopilots.px4 import PX4
from companion.calls import ACCEPTED
from companion.node import COMPONENT
from companion.reception import AUTOPILOT
from companion.takeoff import DO_SET_MODE
from companion.vehicle import Vehicle
from mavlink_bridge.codec import Codec
from mavlink_bridge.messages import CommandAck, CommandLong, Heartbeat, Source
from mavlink_bridge.node import Datagram
from mavlink_bridge.signing import Signing

_AGAIN = 100_000
_PATIENCE = 3_000_000
"""µs between two askings, and until it is given up."""
_HEARTBEAT, _ACK = 0, 77


class LastWord:
    """A ``Node`` with one link, ``autopilot``; times are of the wall. ``heartbeat``: the last that the
    companion heard, None for none. ``over``: nothing more is to be done; ``said``: what came of it."""

    def __init__(self, system: int, heartbeat: Heartbeat | None, signing: Signing | None = None) -> None:
        self.name = f"last-word-{system}"
        self.said = ""
        self._own = Source(system, COMPONENT)
        self._vehicle = Vehicle()
        if heartbeat is not None:
            self._vehicle.hear(heartbeat)
        self._signing = signing
        self._codec = Codec(
            lambda identifier, sender, component: (
                identifier in (_HEARTBEAT, _ACK) and sender == system and component == AUTOPILOT
            ),
            signing,
        )
        self._until: int | None = None
        self._next = 0
        self._asked = self._fresh = False

    @property
    def over(self) -> bool:
        """Whether it holds, is somebody else's, or does not answer."""
        return bool(self.said)

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        """Ask for the mode until it is granted, at most for three seconds."""
        if self._signing is not None:
            self._signing.present(now)
        if self._until is None:
            self._until = now + _PATIENCE
        answer = None
        for datagram in inbox:
            for message in self._codec.feed(datagram.data, whole=True):
                if isinstance(message, CommandAck):
                    answer = message.result if message.command == DO_SET_MODE and self._asked else answer
                else:
                    self._vehicle.hear(message)
                    self._fresh = True
        if not self.over:
            self.said = self._verdict(now, answer)
        if self.over or not self._steered or now < self._next:
            return []
        self._next, self._asked = now + _AGAIN, True
        params = (*self._profile.hold_params, 0.0, 0.0, 0.0, 0.0)
        order = CommandLong(self._own, self._own.system, AUTOPILOT, DO_SET_MODE, 0, params)
        return [Datagram("autopilot", self._codec.encode(order))]

    def _verdict(self, now: int, answer: int | None) -> str:
        """What came of it; empty while that is not known."""
        if not self._vehicle.armed:
            return "not armed"
        if not self._steered:
            if self._asked:
                return f"holds ({self._profile.hold_name})"
            # What the companion heard last may be a moment old.
            return "not ours" if self._fresh or now >= (self._until or 0) else ""
        if answer == ACCEPTED:
            return f"holds ({self._profile.hold_name})"
        return f"did not take {self._profile.hold_name}" if now >= (self._until or 0) else ""

    @property
    def _profile(self) -> Profile:
        return self._vehicle.profile or PX4

    @property
    def _steered(self) -> bool:
        """Whether our set-points steer it."""
        return self._vehicle.armed and self._vehicle.in_guided_mode
