"""Input of a check."""

from __future__ import annotations

from typing import NamedTuple

from companion.flight.autopilots import Profile
from mavlink_bridge.messages import ParamValue, Source
from mavlink_bridge.wire.param_value import number_of
from outrider.doctor.hearing import Hearing
from outrider.doctor.sender_record import SenderRecord


class Case(NamedTuple):
    """One vehicle on one link.

    ``log``: the link is a recording, so missing messages could not be requested. ``me``: sender id of the
    doctor, None if the doctor sends nothing. ``baud``: baud rate of a serial port, None for other links.
    """

    hearing: Hearing
    vehicle: SenderRecord
    log: bool
    me: Source | None
    baud: int | None = None

    @property
    def profile(self) -> Profile | None:
        """Profile of the autopilot, None for an unknown one."""
        return self.vehicle.vehicle.profile

    @property
    def autopilot(self) -> int:
        """Value of MAV_AUTOPILOT; 0 before the first heartbeat."""
        beat = self.vehicle.vehicle.heartbeat
        return beat.autopilot if beat is not None else 0

    @property
    def px4(self) -> bool:
        """Whether the autopilot is PX4."""
        return self.vehicle.is_px4

    def parameter(self, name: str) -> float | None:
        """Return the value of a parameter, None if it was not received or is no number (not finite)."""
        message: ParamValue | None = self.vehicle.parameters.get(name)
        return None if message is None else number_of(message, bytewise=self.px4)

    @property
    def silent(self) -> float:
        """Time from the vehicle's last message to the end of what was recorded on the link (s)."""
        return (self.hearing.end - self.vehicle.last) * 1e-6

    def silent_for(self, message_id: int) -> float:
        """Return the time (s) from the vehicle's last message of that id to the end.

        In a log, the end is the time of the vehicle's last message; on a live link, it is the present.
        Without a message of that id, return the whole duration.
        """
        stream = self.vehicle.streams.get(message_id)
        end = self.vehicle.last if self.log else self.hearing.end
        return self.hearing.seconds if stream is None else (end - stream.last) * 1e-6
