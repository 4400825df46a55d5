"""What a check looks at."""

from __future__ import annotations

from typing import NamedTuple

from companion.flight.autopilots import Profile
from mavlink_bridge.messages import ParamValue, Source
from mavlink_bridge.wire.param_value import number_of
from outrider.doctor.hearing import Hearing
from outrider.doctor.speaker import Speaker

PX4_NUMBER, ARDUPILOT_NUMBER = 12, 3
"""MAV_AUTOPILOT."""
_BYTEWISE = 0x10


class Case(NamedTuple):
    """One vehicle on one link. ``log``: it is a recording, so nobody could ask for what is not in it;
    ``me``: as whom the doctor speaks, None if it does not; ``baud`` of a serial port."""

    hearing: Hearing
    vehicle: Speaker
    log: bool
    me: Source | None
    baud: int | None = None

    @property
    def profile(self) -> Profile | None:
        """The autopilot's ways, None for one that is not known."""
        return self.vehicle.vehicle.profile

    @property
    def autopilot(self) -> int:
        """MAV_AUTOPILOT."""
        beat = self.vehicle.vehicle.heartbeat
        return beat.autopilot if beat is not None else 0

    @property
    def px4(self) -> bool:
        """Whether it is PX4."""
        return self.autopilot == PX4_NUMBER

    def parameter(self, name: str) -> float | None:
        """Its value, None if it was not told, or is no number."""
        message: ParamValue | None = self.vehicle.parameters.get(name)
        return None if message is None else number_of(message, bytewise=self.px4)

    @property
    def silent(self) -> float:
        """s from the last thing that the vehicle said to the end."""
        return (self.hearing.end - self.vehicle.last) * 1e-6

    def silent_for(self, message_id: int) -> float:
        """s from the last such message to the end, in a log to the vehicle's last word; all if none came."""
        stream = self.vehicle.streams.get(message_id)
        end = self.vehicle.last if self.log else self.hearing.end
        return self.hearing.seconds if stream is None else (end - stream.last) * 1e-6
