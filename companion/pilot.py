"""The way into the air and back: connect → arm → take-off → escort → settle → land, by MAVLink commands, each
until acknowledged.

Nothing starts without an operator's go (a NAV_TAKEOFF addressed to the companion), and while the autopilot is
not in the mode in which our set-points steer, none are sent.
"""

from __future__ import annotations

from enum import Enum

from companion.autopilots import Profile, Step, is_guided
from companion.autopilots.known import profile_of
from companion.calls import Calls
from companion.config import CompanionConfig
from companion.tracks import State
from companion.world import View
from mavlink_bridge.messages import (
    CommandAck,
    ExtendedSysState,
    Heartbeat,
    Message,
    Source,
    StatusText,
    SysStatus,
)

DO_SET_MODE, ARM_DISARM, NAV_TAKEOFF, NAV_LAND = 176, 400, 22, 21
REQUEST_MESSAGE, SET_MESSAGE_INTERVAL, GPS_GLOBAL_ORIGIN = 512, 511, 49
WARNING = 4
"""MAV_SEVERITY."""
ARMED, PREARM_OK, INVALID = 0x80, 0x10000000, 8
UNDEFINED, ON_GROUND, IN_AIR = 0, 1, 2
"""MAV_LANDED_STATE; others are on the way up or down."""
_STILL, _CALM = 0.3, 2_000_000
"""m/s and µs: slower than this for so long in the air, a take-off is over."""
HEARTBEAT_LOST = 3_000_000
"""µs without a heartbeat after which the autopilot's mode is not known."""
_NAN = float("nan")
_NEEDED = tuple(
    (SET_MESSAGE_INTERVAL, (identifier, interval, 0.0, 0.0, 0.0, 0.0, 0.0))
    for identifier, interval in ((32.0, 20_000.0), (30.0, 100_000.0), (1.0, 1_000_000.0), (245.0, 500_000.0))
)
"""Message id and interval (µs) asked of the autopilot: LOCAL_POSITION_NED, ATTITUDE, SYS_STATUS,
EXTENDED_SYS_STATE. The attitude tells only where the nose points when the set-points begin."""


class Phase(Enum):
    """Where the flight is."""

    CONNECT = "connect"
    PREPARE = "prepare"
    ESCORT = "escort"
    SETTLE = "settle"
    LAND = "land"
    DONE = "done"


class Pilot:
    """One vehicle's flight, as a state machine over what has been heard. It sends commands, never set-points.

    ``origin_altitude``: of the fleet frame's zero, m above mean sea level.
    """

    def __init__(self, config: CompanionConfig, own: Source, origin_altitude: float) -> None:
        self._config = config
        self._origin_altitude = origin_altitude
        self.phase = Phase.CONNECT
        self.profile: Profile | None = None
        self.waiting_for = "a heartbeat of the autopilot"
        self.said = ""
        """The last warning of the autopilot: usually why it refuses."""
        self._heartbeat: Heartbeat | None = None
        self._beaten: Heartbeat | None = None
        self._now = self._beat_at = 0
        self._settling_since: int | None = None
        self._status: SysStatus | None = None
        self._extended: ExtendedSysState | None = None
        self._extended_seen: ExtendedSysState | None = None
        self._extended_at = 0
        self._flying_already = False
        self._calm_since: int | None = None
        self._height: float | None = None
        self._ground = 0.0
        self._step = 0
        self._calls = Calls(own)

    @property
    def refusals(self) -> list[str]:
        """Commands that the autopilot refused, in words."""
        return self._calls.refusals

    @property
    def guided(self) -> bool:
        """Whether the autopilot follows our set-points now."""
        return (
            self.profile is not None
            and self._heartbeat is not None
            and self._now - self._beat_at <= HEARTBEAT_LOST
            and bool(self._heartbeat.base_mode & ARMED)
            and is_guided(self.profile, self._heartbeat)
        )

    @property
    def streaming(self) -> bool:
        """Whether set-points are to be sent."""
        if self.phase in (Phase.ESCORT, Phase.SETTLE):
            return self.guided
        return (
            self.phase is Phase.PREPARE
            and self.profile is not None
            and self.profile.streams_first
            and self.profile.steps[self._step] is Step.MODE
        )

    def hear(self, message: Message) -> None:
        """A message of the own autopilot."""
        if isinstance(message, Heartbeat):
            if message.autopilot != INVALID:
                self._heartbeat = message
                self.profile = profile_of(message)
        elif isinstance(message, SysStatus):
            self._status = message
        elif isinstance(message, ExtendedSysState):
            self._extended = message
        elif isinstance(message, StatusText):
            if message.severity <= WARNING:
                self.said = message.text
        elif isinstance(message, CommandAck):
            self._calls.hear(message)

    def go(self, height: float) -> bool:
        """The operator's go: climb to ``height`` metres above the start, or take over where it flies already.
        Whether it is taken."""
        if self.phase not in (Phase.CONNECT, Phase.PREPARE) or not 0.5 <= height <= 120.0:
            return self.phase is Phase.ESCORT
        self._height = height
        return True

    def land(self) -> bool:
        """The operator's order to land. A vehicle under way first comes to a hover clear of the others,
        because an autopilot that lands looks out for nobody."""
        if self.phase is Phase.CONNECT:
            # Nothing is in the air yet, and an earlier go is taken back.
            self._height = None
        if self.phase is Phase.ESCORT:
            self.phase = Phase.SETTLE
        elif self.phase is Phase.PREPARE:
            self.phase = Phase.LAND
        return True

    def settled(self) -> None:
        """The vehicle hovers clear of the others: land now."""
        if self.phase is Phase.SETTLE:
            self.phase = Phase.LAND

    def step(self, now: int, view: View) -> list[Message]:
        """Commands to send now."""
        self._tick(now)
        if self._extended is not self._extended_seen:
            self._extended_seen, self._extended_at = self._extended, now
        if self.phase is Phase.SETTLE:
            self._settle(now, view)
        if self.phase is Phase.CONNECT:
            return self._connect(now, view)
        if self.phase is Phase.PREPARE:
            return self._prepare(now, view)
        if self.phase is Phase.LAND:
            if self._heartbeat is not None and not self._heartbeat.base_mode & ARMED:
                self.phase = Phase.DONE
                return []
            return self._calls.call(now, NAV_LAND, (0.0, 0.0, 0.0, _NAN, _NAN, _NAN, 0.0))
        return []

    def _tick(self, now: int) -> None:
        """It is ``now`` (µs); a heartbeat that has come since the last step came then."""
        self._now = now
        if self._heartbeat is not self._beaten:
            self._beaten, self._beat_at = self._heartbeat, now

    def _settle(self, now: int, view: View) -> None:
        """Land without settling when that cannot go on: blind, or too long. Somebody who took the vehicle
        over by its mode switch keeps it: nothing is ordered against them."""
        since = self._settling_since = now if self._settling_since is None else self._settling_since
        taken_over = not self.guided and now - self._beat_at <= HEARTBEAT_LOST
        blind = view.own is None or view.own.age > self._config.guard.own_stale_us
        if not taken_over and (blind or now - since > self._config.guard.settle_us):
            self.phase = Phase.LAND

    def _connect(self, now: int, view: View) -> list[Message]:
        calls: list[Message] = []
        self.waiting_for = self._missing(view)
        if self._heartbeat is not None:
            for command, params in sorted(_NEEDED, key=lambda call: self._calls.sent_at(*call)):
                calls += self._calls.call(now, command, params)
            if view.local is None:
                calls += self._calls.call(
                    now, REQUEST_MESSAGE, (GPS_GLOBAL_ORIGIN, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
                )
        if not self.waiting_for and view.own is not None and view.local is not None:
            self._ground = float(view.own.position[2])
            self._flying_already = self._armed and self._landed_state != ON_GROUND
            self._calm_since = None
            self.phase = Phase.PREPARE
        return calls

    @property
    def _armed(self) -> bool:
        return self._heartbeat is not None and bool(self._heartbeat.base_mode & ARMED)

    @property
    def _landed_state(self) -> int:
        """As last heard, UNDEFINED if that is too long ago."""
        if self._extended is None or self._now - self._extended_at > HEARTBEAT_LOST:
            return UNDEFINED
        return self._extended.landed_state

    def _missing(self, view: View) -> str:
        if self._heartbeat is None:
            return "a heartbeat of the autopilot"
        if self.profile is None:
            return f"an autopilot that is known (ArduPilot 3, PX4 12; this is {self._heartbeat.autopilot})"
        if view.local is None:
            return "GPS_GLOBAL_ORIGIN"
        if view.own is None or view.own.age > self._config.guard.own_stale_us:
            return "LOCAL_POSITION_NED"
        if view.yaw is None:
            return "ATTITUDE"
        if self._armed and self._landed_state == UNDEFINED:
            # A vehicle that may be flying must not be told to take off.
            return "EXTENDED_SYS_STATE, whether the armed vehicle is on the ground"
        if self._status is None or not self._status.health & PREARM_OK:
            return "the autopilot's pre-arm checks"
        if not all(self._calls.answered(*call) for call in _NEEDED):
            return "the autopilot's answers to SET_MESSAGE_INTERVAL"
        if self._height is None:
            return "the operator's go"
        return ""

    def _prepare(self, now: int, view: View) -> list[Message]:
        profile, beat, height = self.profile, self._heartbeat, self._height
        if profile is None or beat is None or height is None or view.own is None:
            return []
        if Step.ARM in profile.steps[: self._step] and not beat.base_mode & ARMED:
            # Disarmed again, by itself or by somebody, who will not expect it to arm: a new go is needed.
            self._step, self._height, self.phase = 0, None, Phase.CONNECT
            self._calls.forget()
            return []
        step = profile.steps[self._step]
        if step is Step.MODE:
            done = is_guided(profile, beat)
            call = self._calls.call(now, DO_SET_MODE, (*profile.mode_params, 0.0, 0.0, 0.0, 0.0))
        elif step is Step.ARM:
            done = bool(beat.base_mode & ARMED)
            call = self._calls.call(now, ARM_DISARM, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
        else:
            climbed = float(view.own.position[2]) - self._ground
            done = self._flying_already or self._is_up(now, view.own, climbed, height)
            above_sea = self._origin_altitude + self._ground + height
            altitude = above_sea if profile.takeoff_absolute else height
            up = self._flying_already or self._landed_state not in (UNDEFINED, ON_GROUND)
            call = (
                [] if up else self._calls.call(now, NAV_TAKEOFF, (0.0, 0.0, 0.0, _NAN, _NAN, _NAN, altitude))
            )
        if done:
            self._step += 1
            self._calls.forget()
            if self._step == len(profile.steps):
                self.phase = Phase.ESCORT
            return []
        self.waiting_for = step.value
        return call

    def _is_up(self, now: int, own: State, climbed: float, height: float) -> bool:
        """Still at the height asked for; or still for a while in the air, for an estimate of height that
        drifts by more than one may ask: the autopilot measures its height from its own origin."""
        still = float(abs(own.velocity).max()) < _STILL
        if not still or self._landed_state != IN_AIR or climbed < 0.5 * height:
            self._calm_since = None
        elif self._calm_since is None:
            self._calm_since = now
        waited = self._calm_since is not None and now - self._calm_since >= _CALM
        return waited or (still and abs(climbed - height) < 0.3)
