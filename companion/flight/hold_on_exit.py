"""Hold on exit: the request to the autopilot to hold its position when its companion ends.

An autopilot that has received positions and velocities continues along them until its time-out. So the
process that detects the end of a companion requests the mode in which the autopilot holds its position by
itself; but only if the companion's set-points steered last: otherwise another controller has the vehicle. The
result follows from the autopilot's heartbeat: an acknowledgement may be for another sender, or for a mode
that did not last.
"""

from __future__ import annotations

from collections.abc import Sequence

from pymavlink.dialects.v20 import all as mavlink

from companion.flight.autopilots import Profile
from companion.flight.autopilots.px4 import PX4
from companion.flight.vehicle import Vehicle
from companion.values.components import COMPONENT
from mavlink_bridge.messages import CommandAck, CommandLong, Heartbeat, Source
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.signing import Signing

_RETRY_US, _ACCEPTED_RETRY_US = 100_000, 1_500_000
"""µs until the next request: normally, and after an accepted one, to wait for a heartbeat with the mode."""
_TIMEOUT_US = 3_000_000
"""µs from the first step until the attempt is given up."""
_RECEIVED = frozenset((mavlink.MAVLINK_MSG_ID_HEARTBEAT, mavlink.MAVLINK_MSG_ID_COMMAND_ACK))


class HoldOnExit:
    """``Node`` with one link, ``autopilot``, that requests the hold mode; times are wall-clock µs.

    ``heartbeat``: the last that the companion received, None for none; ``steered``: whether the companion
    controlled the vehicle. ``said``: the result, empty until ``over``; ``failed``: the
    vehicle may continue along the last set-points.
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
                identifier in _RECEIVED and sender == system and component == mavlink.MAV_COMP_ID_AUTOPILOT1
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
        """Whether the attempt is over: hold mode, disarmed, taken over, never heard, or no success in 3 s."""
        return bool(self.said)

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        """Return the request for the hold mode while it is needed, for at most three seconds."""
        if self._signing is not None:
            self._signing.present(now)
        if self._until is None:
            self._until = now + _TIMEOUT_US
        for datagram in inbox:
            for message in self._codec.feed(datagram.data, whole=True):
                if not isinstance(message, CommandAck):
                    self._vehicle.receive(message)
                    self._fresh = True
                elif self._asked and _grants(message):
                    self._next = now + _ACCEPTED_RETRY_US
        if not self.over:
            self.said = self._verdict(late=now >= self._until)
        if self.over or not self._steered or now < self._next:
            return []
        self._next, self._asked = now + _RETRY_US, True
        hold = self._profile.hold_call
        target = self._own.system, mavlink.MAV_COMP_ID_AUTOPILOT1
        order = CommandLong(self._own, *target, mavlink.MAV_CMD_DO_SET_MODE, 0, hold)
        return [Datagram("autopilot", self._codec.encode(order))]

    def _verdict(self, *, late: bool) -> str:
        """Return the result, or an empty string while it is not known; ``late``: the time is over.

        The companion's last heartbeat may be outdated, so a newer one is awaited.
        """
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
        """Whether the vehicle is armed and in guided mode."""
        return self._vehicle.armed and self._vehicle.in_guided_mode


def _grants(ack: CommandAck) -> bool:
    return (ack.command, ack.result) == (mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_RESULT_ACCEPTED)
