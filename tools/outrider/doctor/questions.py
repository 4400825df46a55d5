"""What a doctor asks on a live link, and how: little, slowly, and nothing that changes anything.

It sends HEARTBEAT, REQUEST_MESSAGE and PARAM_REQUEST_READ, and asks a disarmed vehicle whose pre-arm check
fails for the reasons. No rate is set: REQUEST_MESSAGE shows as well whether there is such a message, and
whoever watches the vehicle at that moment keeps the rates that they have asked for.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from mavlink_bridge.messages import CommandLong, Heartbeat, Message, ParamRequestRead, Source
from outrider.doctor.case import PX4_NUMBER
from outrider.doctor.examination import Examination
from outrider.doctor.objections import Objections
from outrider.doctor.settings import names
from outrider.doctor.speaker import Speaker

COMPONENT: Final = 193
"""MAV_COMP_ID_ONBOARD_COMPUTER3. Not a ground station: its HEARTBEAT, once heard and then lost, is what
FS_GCS_ENABLE and NAV_DLL_ACT act upon. Not 195, which is ``fly``'s: others would take the doctor for it."""
STRANGER: Final = Source(245, COMPONENT)
"""Who speaks before the vehicle's system id is known: a serial link, say, may wait to be spoken to."""
_ONBOARD_CONTROLLER, _INVALID, _ACTIVE = 18, 8, 4
_HEARTBEAT_EVERY: Final = 1_000_000
_PATIENCE: Final = 700_000
"""µs until it asks again, and a moment for what flows by itself."""
_LISTEN: Final = 2_000_000
_TRIES: Final = 3
_AT_ONCE: Final = 2
"""Questions in one step: 57 600 baud carry a hundred a second, but have other things to do."""
_REQUEST_MESSAGE: Final = 512
_ONCE: Final = (148, 49, 242)
"""AUTOPILOT_VERSION, GPS_GLOBAL_ORIGIN, HOME_POSITION: asked for at once, as they rarely flow."""
_FLOWING: Final = (1, 32, 30, 33, 245, 24, 147, 2)
_ESTIMATOR: Final = {True: 230, False: 193}
"""Its state's message, by whether it is PX4."""


class _Asked(NamedTuple):
    times: int
    last: int


class Questions:
    """Of one vehicle. ``examination`` says who it is, and what has been answered."""

    def __init__(self, examination: Examination) -> None:
        self._examination = examination
        self._asked: dict[int | str, _Asked] = {}
        self._objections = Objections()
        self._met: int | None = None
        self._whom: Source | None = None
        self._beat: int | None = None
        self.me = STRANGER

    def due(self, now: int) -> list[Message]:
        """What to say at ``now`` (µs)."""
        vehicle = self._examination.vehicle
        if vehicle is not None:
            if vehicle.source != self._whom:
                # One with a lower id has spoken up: begin anew.
                self._whom, self._met = vehicle.source, now
                self._asked.clear()
                self._examination.asked.clear()
                self._objections = Objections()
            self.me = self._examination.me = Source(vehicle.source.system, COMPONENT)
        said: list[Message] = []
        if self._beat is None or now - self._beat >= _HEARTBEAT_EVERY:
            self._beat = now
            said.append(Heartbeat(self.me, _ONBOARD_CONTROLLER, _INVALID, 0, 0, _ACTIVE))
        if vehicle is not None:
            open_ones = [key for key in self._wanted(vehicle, now) if self._is_open(key, vehicle, now)]
            said += [self._ask(key, vehicle, now) for key in open_ones[:_AT_ONCE]]
            said += self._objections.due(vehicle, self.me, now)
        return said

    def done(self, now: int) -> bool:
        """Whether everything was answered, or asked for often enough."""
        vehicle = self._examination.vehicle
        if vehicle is None or self._met is None or now - self._met < _LISTEN:
            return False
        return not any(
            self._asked.get(key, _Asked(0, 0)).times < _TRIES or now - self._asked[key].last < _PATIENCE
            for key in self._wanted(vehicle, now)
            if not _answered(key, vehicle)
        )

    def listening(self, now: int) -> int:
        """For how long (µs) it waits at most for the reasons of a failed pre-arm check."""
        vehicle = self._examination.vehicle
        return 0 if vehicle is None else self._objections.left(vehicle, now)

    def _wanted(self, vehicle: Speaker, now: int) -> tuple[int | str, ...]:
        px4 = _is_px4(vehicle)
        wanted: tuple[int | str, ...] = _ONCE + names(px4=px4)
        if self._met is not None and now - self._met >= _LISTEN:
            wanted += (*_FLOWING, _ESTIMATOR[px4])
        return wanted

    def _is_open(self, key: int | str, vehicle: Speaker, now: int) -> bool:
        times, last = self._asked.get(key, _Asked(0, 0))
        return not _answered(key, vehicle) and times < _TRIES and (times == 0 or now - last >= _PATIENCE)

    def _ask(self, key: int | str, vehicle: Speaker, now: int) -> Message:
        times, _ = self._asked.get(key, _Asked(0, 0))
        self._asked[key] = _Asked(times + 1, now)
        system, component = vehicle.source
        if isinstance(key, str):
            return ParamRequestRead(self.me, -1, system, component, key)
        self._examination.asked[key] = times + 1
        params = (float(key), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        return CommandLong(self.me, system, component, _REQUEST_MESSAGE, 0, params)


def _answered(key: int | str, vehicle: Speaker) -> bool:
    return key in vehicle.parameters if isinstance(key, str) else key in vehicle.streams


def _is_px4(vehicle: Speaker) -> bool:
    beat = vehicle.vehicle.heartbeat
    return beat is not None and beat.autopilot == PX4_NUMBER
