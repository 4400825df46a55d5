"""The last word to the autopilot when its companion ends: stay where you are.

An autopilot that was just told positions and velocities flies on along them for its time-out. So whoever
sees a companion end asks for the mode in which the autopilot holds its place by itself; but only where our
set-points steered last: whoever else has the vehicle keeps it. What came of it the autopilot's heartbeat
says: an acknowledgement may be somebody else's, or that of a mode that did not last.
"""

from __future__ import annotations

from collections.abc import Sequence

from companion.flight.autopilots import Profile
from companion.flight.autopilots.px4 import PX4
from companion.flight.command_protocol import ACCEPTED, DO_SET_MODE
from companion.flight.vehicle import Vehicle
from companion.values.components import AUTOPILOT, COMPONENT
from mavlink_bridge.messages import CommandAck, CommandLong, Heartbeat, Source
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.signing import Signing

_AGAIN, _GRANTED = 100_000, 1_500_000
"""µs between two askings, and after one that was accepted: until then the heartbeat has told of it."""
_PATIENCE = 3_000_000
"""µs until it is given up."""
_HEARTBEAT, _ACK = 0, 77


class LastWord:
    """A ``Node`` with one link, ``autopilot``; times are of the wall. ``heartbeat``: the last that the
    companion heard, None for none; ``steered``: whether it had the vehicle. ``over``: nothing more is to be
    done; ``said``: what came of it; ``failed``: the vehicle may fly on along the last set-points.
    """

    def __init__(
        self,
        system: int,
        heartbeat: Heartbeat | None,
        signing: Signing | None = None,
        *,
        steered: bool = True,
    ) -> None:
        self.name = f"last-word-{system}"
        self.said = ""
        self.failed = False
        self._own = Source(system, COMPONENT)
        self._vehicle = Vehicle()
        if heartbeat is not None:
            self._vehicle.receive(heartbeat)
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
        if heartbeat is None:
            self.said = "not heard"
        elif not steered:
            self.said = "not ours" if self._vehicle.armed else "not armed"

    @property
    def over(self) -> bool:
        """Whether it holds, is somebody else's, or does not answer."""
        return bool(self.said)

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        """Ask for the mode until the autopilot is in it, at most for three seconds."""
        if self._signing is not None:
            self._signing.present(now)
        if self._until is None:
            self._until = now + _PATIENCE
        for datagram in inbox:
            for message in self._codec.feed(datagram.data, whole=True):
                if not isinstance(message, CommandAck):
                    self._vehicle.receive(message)
                    self._fresh = True
                elif message.command == DO_SET_MODE and message.result == ACCEPTED and self._asked:
                    self._next = now + _GRANTED
        if not self.over:
            self.said = self._verdict(late=now >= self._until)
        if self.over or not self._steered or now < self._next:
            return []
        self._next, self._asked = now + _AGAIN, True
        hold = self._profile.hold_call
        order = CommandLong(self._own, self._own.system, AUTOPILOT, DO_SET_MODE, 0, hold)
        return [Datagram("autopilot", self._codec.encode(order))]

    def _verdict(self, *, late: bool) -> str:
        """What came of it; empty while that is not known: what the companion heard last may be a moment
        old."""
        vehicle, name = self._vehicle, self._profile.hold_name
        if not self._fresh and not late:
            return ""
        if not vehicle.armed:
            return "not armed"
        if self._steered:
            self.failed = late
            return f"did not take {name}" if late else ""
        beat = vehicle.heartbeat
        held = beat is not None and beat.custom_mode == self._profile.hold_mode
        return f"holds ({name})" if held and self._asked else "not ours"

    @property
    def _profile(self) -> Profile:
        return self._vehicle.profile or PX4

    @property
    def _steered(self) -> bool:
        """Whether our set-points steer it."""
        return self._vehicle.armed and self._vehicle.in_guided_mode
