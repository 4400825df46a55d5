"""State of the own autopilot by its messages: mode, arming, landed state, pre-arm checks, warnings."""

from __future__ import annotations

from collections import deque

from pymavlink.dialects.v20 import all as mavlink

from companion.flight.autopilots import Profile, is_guided
from companion.flight.autopilots.known import profile_of
from companion.flight.positioning import Positioning
from mavlink_bridge.messages import (
    EkfStatus,
    EstimatorStatus,
    ExtendedSysState,
    GpsRaw,
    Heartbeat,
    Message,
    StatusText,
    SysStatus,
)

HEARTBEAT_LOST = 3_000_000
"""µs without a heartbeat after which the autopilot's mode is unknown."""
_UNREPORTED_US = 7_500_000
"""µs for which a vehicle must be disarmed in addition if its autopilot never reports EXTENDED_SYS_STATE."""
_MAX_TEXTS = 16
_CRUISING = (mavlink.MAV_LANDED_STATE_IN_AIR, mavlink.MAV_LANDED_STATE_UNDEFINED)


class Vehicle:
    """State of one autopilot, from its messages.

    Messages are dated by ``tick``: a message received since the last tick is dated at the next.
    """

    def __init__(self) -> None:
        self.heartbeat: Heartbeat | None = None
        self.profile: Profile | None = None
        self.said = ""
        """Last text of severity warning or higher; usually the reason for a refusal."""
        self.texts: deque[StatusText] = deque(maxlen=_MAX_TEXTS)
        """The last texts of any severity, at most 16; ``reported`` counts all texts so far."""
        self.reported = 0
        self.status: SysStatus | None = None
        self.positioning = Positioning()
        self._extended: ExtendedSysState | None = None
        self._contradicted = False
        self._rested_at: int | None = None
        self._dated_heartbeat: Heartbeat | None = None
        self._dated_extended: ExtendedSysState | None = None
        self.now = self._beat_at = self._extended_at = 0

    def receive(self, message: Message) -> None:
        """Receive a message of the autopilot."""
        if isinstance(message, Heartbeat):
            if message.autopilot != mavlink.MAV_AUTOPILOT_INVALID:
                self.heartbeat = message
                self.profile = profile_of(message)
                self._contradicted |= self.armed
        elif isinstance(message, SysStatus):
            self.status = message
        elif isinstance(message, ExtendedSysState):
            self._extended = message
            self._contradicted |= message.landed_state != mavlink.MAV_LANDED_STATE_ON_GROUND
        elif isinstance(message, GpsRaw | EkfStatus | EstimatorStatus):
            self.positioning.receive(message)
        elif isinstance(message, StatusText):
            self.texts.append(message)
            self.reported += 1
            if message.severity <= mavlink.MAV_SEVERITY_WARNING:
                self.said = message.text

    def tick(self, now: int) -> None:
        """Set the time to ``now`` (µs) and date the messages received since the last call."""
        self.now = now
        self.positioning.tick(now)
        if self.heartbeat is not self._dated_heartbeat:
            self._dated_heartbeat, self._beat_at = self.heartbeat, now
        if self._extended is not self._dated_extended:
            self._dated_extended, self._extended_at = self._extended, now
        beat, extended = self.heartbeat, self._extended
        grounded = extended is None or extended.landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND
        rests = beat is not None and not self.armed and grounded
        if not rests or self._contradicted:
            self._rested_at = None
        elif self._rested_at is None:
            self._rested_at = now
        self._contradicted = False

    @property
    def rested_for(self) -> int:
        """Time (µs) for which all messages have said that the vehicle is disarmed and on the ground.

        It is 0 while one of the two is unknown, except for an autopilot that never reports a landed state:
        then being disarmed counts, but not in the first ``_UNREPORTED_US``. One message that says otherwise
        begins it anew: another sender may use the autopilot's ids. An autopilot that has fallen silent says
        nothing else.
        """
        if self._rested_at is None:
            return 0
        rested = self.now - self._rested_at
        return rested if self._extended is not None else max(0, rested - _UNREPORTED_US)

    @property
    def beat_at(self) -> int:
        """When (µs) the last heartbeat arrived, 0 before the first."""
        return self._beat_at

    @property
    def alive(self) -> bool:
        """Whether the last heartbeat is at most 3 s old, so that the mode is valid."""
        return self.heartbeat is not None and self.now - self._beat_at <= HEARTBEAT_LOST

    @property
    def armed(self) -> bool:
        """Whether the motors are armed, according to the last heartbeat."""
        beat = self.heartbeat
        return beat is not None and bool(beat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)

    @property
    def guided(self) -> bool:
        """Whether the vehicle follows set-points now: alive, armed and in guided mode."""
        return self.alive and self.armed and self.in_guided_mode

    @property
    def in_guided_mode(self) -> bool:
        """Whether the last reported mode is the one in which the vehicle follows set-points."""
        beat, profile = self.heartbeat, self.profile
        return beat is not None and profile is not None and is_guided(profile, beat)

    @property
    def mode(self) -> int:
        """Last reported custom_mode; 0 before the first heartbeat."""
        return 0 if self.heartbeat is None else self.heartbeat.custom_mode

    @property
    def flies(self) -> bool:
        """Whether the vehicle may be in the air: armed, and not reported as on the ground."""
        return self.armed and self.landed_state != mavlink.MAV_LANDED_STATE_ON_GROUND

    @property
    def cruises(self) -> bool:
        """Whether the vehicle is in the air and its autopilot reports neither a take-off nor a landing.

        Without a report it is in the air while it is armed.
        """
        return self.flies and self.landed_state in _CRUISING

    @property
    def left_by_us(self) -> bool:
        """Whether the vehicle is in guided mode, or in the hold mode, in which the companion leaves it."""
        return self.in_guided_mode or (self.profile is not None and self.mode == self.profile.hold_mode)

    @property
    def starved(self) -> bool:
        """Whether the vehicle is disarmed in a guided mode whose pre-arm checks fail without set-points."""
        profile = self.profile
        return profile is not None and profile.streams_first and self.in_guided_mode and not self.armed

    @property
    def healthy(self) -> bool:
        """Whether the vehicle's pre-arm checks have passed."""
        return self.status is not None and bool(self.status.health & mavlink.MAV_SYS_STATUS_PREARM_CHECK)

    @property
    def landed_state(self) -> int:
        """Last reported MAV_LANDED_STATE, undefined if the report is too old."""
        undefined: int = mavlink.MAV_LANDED_STATE_UNDEFINED
        if self._extended is None or self.now - self._extended_at > HEARTBEAT_LOST:
            return undefined
        return self._extended.landed_state
