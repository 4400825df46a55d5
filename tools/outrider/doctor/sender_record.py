"""Record of one component on the link."""

from __future__ import annotations

from collections import deque
from typing import Final, TypeVar, cast

from pymavlink.dialects.v20 import all as mavlink

from companion.flight.vehicle import Vehicle
from mavlink_bridge.messages import (
    Attitude,
    AttitudeQuaternion,
    AutopilotVersion,
    EkfStatus,
    EstimatorStatus,
    GlobalPosition,
    GpsGlobalOrigin,
    GpsRaw,
    Heartbeat,
    LocalPosition,
    Message,
    ParamValue,
    PositionTarget,
    Source,
    StatusText,
    SysStatus,
    SystemTime,
)
from mavlink_bridge.wire.framing import Frame
from outrider.doctor.boot_clock import BootClock
from outrider.doctor.condition import Condition
from outrider.doctor.px4_events import reason
from outrider.doctor.slope import Slope

M = TypeVar("M", bound=Message)
_KEPT_FRAMES, _KEPT_TEXTS, _KEPT_PARAMETERS, _KEPT_PLACES = 32, 40, 4096, 8
_KEPT_OBJECTIONS: Final = 16
_REASON_PREFIXES: Final = ("prearm", "preflight", "arming denied", "arm:")
_REASON_LIFETIME_US: Final = 35_000_000
"""µs; ArduPilot repeats its reasons every 30 s, so a reason that is not repeated is resolved."""
_MAX_PAIR_INTERVAL_US: Final = 60_000
"""Largest difference of the time stamps of two positions that are compared (µs)."""


class Stream:
    """One message id of one component: count, first and last time (µs), longest silence (µs)."""

    __slots__ = ("count", "first", "last", "longest")

    def __init__(self, now: int) -> None:
        self.count = 0
        self.first = self.last = now
        self.longest = 0

    def tell(self, now: int) -> None:
        """Count a message at ``now`` (µs)."""
        self.count += 1
        self.longest = max(self.longest, now - self.last)
        self.last = now

    @property
    def rate(self) -> float:
        """Messages per second of the receiver's clock; 0 for fewer than two."""
        return (self.count - 1) / ((self.last - self.first) * 1e-6) if self.last > self.first else 0.0


_BOOT_TIMED = (Attitude, AttitudeQuaternion, GlobalPosition, LocalPosition, PositionTarget, SystemTime)
"""Messages with a time stamp of the autopilot's common clock; RAW_IMU, for example, has a sensor's."""


class SenderRecord:
    """Record of all that ``source`` has sent.

    ``repeated``: number of frames equal to one of the last 32, which are ignored otherwise. ``origins``: each
    GPS_GLOBAL_ORIGIN that differs from the previous one, at most eight. ``pair``: the last global and local
    position whose time stamps differ by at most 60 ms. ``guided_losses``: number of times that the armed
    vehicle left the mode that follows set-points for a failsafe's mode, as when set-points stop.
    """

    def __init__(self, source: Source) -> None:
        self.source = source
        self.vehicle = Vehicle()
        self.streams: dict[int, Stream] = {}
        self.clock = BootClock()
        self.parameters: dict[str, ParamValue] = {}
        self.texts: deque[tuple[int, StatusText]] = deque(maxlen=_KEPT_TEXTS)
        self._objections: dict[str, int] = {}
        self.frames = self.repeated = self.signed = self.guided_losses = 0
        self.last = 0
        """Time of its last frame (µs)."""
        self.versions: set[int] = set()
        self.identities: set[tuple[int, bytes]] = set()
        self.origins: list[GpsGlobalOrigin] = []
        self.pair: tuple[GlobalPosition, LocalPosition] | None = None
        self.armable, self.located, self.fixed = Condition(), Condition(), Condition()
        self.climb = Slope()
        self.tells_checks = False
        """Whether SYS_STATUS ever contained the pre-arm check."""
        self._latest: dict[type, Message] = {}
        self._recent: deque[bytes] = deque(maxlen=_KEPT_FRAMES)

    def tell(self, now: int, frame: Frame, message: Message | None) -> None:
        """Add ``frame`` at ``now`` (µs) with its ``message``, None for one that is not decoded."""
        if frame.data in self._recent:
            self.repeated += 1
            return
        self._recent.append(frame.data)
        self.frames += 1
        self.last = now
        self.signed += frame.signed
        self.versions.add(frame.version)
        self.streams.setdefault(frame.message_id, Stream(now)).tell(now)
        if message is not None:
            self._note(now, message)
        elif objection := reason(frame, self.vehicle.mode):
            self._object(now, objection)

    def latest(self, kind: type[M]) -> M | None:
        """Return the last message of ``kind``, None if there is none."""
        return cast("M | None", self._latest.get(kind))

    def rate(self, message_id: int) -> float:
        """Return messages per second of the sender's clock: a simulation may be faster than real time."""
        stream = self.streams.get(message_id)
        return 0.0 if stream is None else stream.rate / (self.clock.rate or 1.0)

    @property
    def objections(self) -> list[str]:
        """Reasons against arming from its texts and events, up to 35 s older than the latest."""
        return [
            text for text, then in self._objections.items() if self.objected_at - then <= _REASON_LIFETIME_US
        ]

    @property
    def objected_at(self) -> int:
        """Time of the last reason against arming (µs)."""
        return max(self._objections.values(), default=0)

    @property
    def heartbeat(self) -> Heartbeat | None:
        """Last heartbeat, also of a component that is no autopilot."""
        return self.latest(Heartbeat)

    @property
    def is_autopilot(self) -> bool:
        """Whether it is an autopilot, by its heartbeat."""
        beat = self.heartbeat
        return (
            beat is not None
            and beat.autopilot != mavlink.MAV_AUTOPILOT_INVALID
            and beat.type != mavlink.MAV_TYPE_GCS
        )

    @property
    def is_px4(self) -> bool:
        """Whether it is a PX4, by its heartbeat."""
        return self.heartbeat is not None and bool(self.heartbeat.autopilot == mavlink.MAV_AUTOPILOT_PX4)

    @property
    def is_ground_station(self) -> bool:
        """Whether it is a ground station, by its heartbeat."""
        return self.heartbeat is not None and self.heartbeat.type == mavlink.MAV_TYPE_GCS

    def _note(self, now: int, message: Message) -> None:
        if isinstance(message, _BOOT_TIMED) and message.time_boot:
            self.clock.tell(now, message, message.time_boot)
        guided = self.vehicle.armed and self.vehicle.in_guided_mode
        self.vehicle.receive(message)
        self.vehicle.tick(now)
        match message:
            case Heartbeat():
                profile = self.vehicle.profile
                fell = profile is not None and message.custom_mode in profile.fallen_modes
                failed = fell and message.system_status >= mavlink.MAV_STATE_CRITICAL
                self.guided_losses += guided and self.vehicle.armed and failed
            case StatusText():
                self.texts.append((now, message))
                if message.text.lower().startswith(_REASON_PREFIXES):
                    self._object(now, message.text.strip())
            case ParamValue() if len(self.parameters) < _KEPT_PARAMETERS:
                self.parameters[message.name] = message
            case AutopilotVersion() if len(self.identities) < _KEPT_PLACES:
                self.identities.add((message.uid, message.uid2))
            case SysStatus():
                self.armable.tell(now, self.vehicle.healthy)
                self.tells_checks |= bool(
                    (message.present | message.health) & mavlink.MAV_SYS_STATUS_PREARM_CHECK
                )
            case EkfStatus() | EstimatorStatus():
                # The two messages share the bit.
                self.located.tell(now, bool(message.flags & mavlink.ESTIMATOR_POS_HORIZ_ABS))
            case GpsRaw():
                self.fixed.tell(now, message.fix_type >= mavlink.GPS_FIX_TYPE_3D_FIX)
            case GpsGlobalOrigin():
                self._move(message)
            case GlobalPosition():
                before = self.latest(GlobalPosition)
                if before is not None:
                    seconds = (message.time_boot - before.time_boot) * 1e-6
                    if 0.0 < seconds < 1.0:
                        middle = -0.5 * (message.velocity_ned[2] + before.velocity_ned[2])
                        self.climb.tell(middle * seconds, message.altitude - before.altitude)
                self._match(message, self.latest(LocalPosition))
            case LocalPosition():
                self._match(self.latest(GlobalPosition), message)
            case _:
                pass
        self._latest[type(message)] = message

    def _object(self, now: int, objection: str) -> None:
        if objection in self._objections or len(self._objections) < _KEPT_OBJECTIONS:
            self._objections[objection] = now

    def _move(self, origin: GpsGlobalOrigin) -> None:
        place = origin[1:4]
        if (not self.origins or self.origins[-1][1:4] != place) and len(self.origins) < _KEPT_PLACES:
            self.origins.append(origin)

    def _match(self, there: GlobalPosition | None, here: LocalPosition | None) -> None:
        if (
            there is not None
            and here is not None
            and abs(there.time_boot - here.time_boot) <= _MAX_PAIR_INTERVAL_US
        ):
            self.pair = there, here
