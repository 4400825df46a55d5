"""Health monitor: detects what is wrong and for how long, and defines the reaction.

Each concern has a condition, usually a limit in ``GuardConfig``; a reaction, which is undone only by an order
and never by the end of the concern; and a text for the ground, sent when the concern begins and when it ends.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from enum import Enum
from typing import NamedTuple

from pymavlink.dialects.v20 import all as mavlink

from companion.avoidance.certified.fleet_clock import TimeTrouble
from companion.config import CompanionConfig
from companion.flight.guard import Holding
from companion.flight.vehicle import Vehicle
from companion.telemetry.status_text import Severity
from companion.values.phase import UNDER_WAY, Phase
from companion.values.refused_senders import RefusedSenders
from companion.world import View


class Reaction(Enum):
    """Reactions of the companion, in order of increasing severity."""

    TELL = "tell"
    RETURN = "come back and land"
    LAND = "come to a hover clear of the others and land"


class Concern(NamedTuple):
    """A present fault; ``name`` identifies it, ``text`` describes it to the ground."""

    name: str
    text: str
    reaction: Reaction = Reaction.TELL
    severity: Severity = Severity.WARNING


class HealthInputs(NamedTuple):
    """Inputs from which concerns are determined.

    ``late``: µs from the last step's due time to this step; ``neighbours``: age (µs) by system id;
    ``holding``: what is flown; ``failing``: since when (µs) no plan could be solved, None while plans are
    found; ``clock_steps``: how often the autopilot's clock has been set; ``moves``: how often the autopilot's
    origin has moved, the last time shifting the vehicle by ``displaced`` m; ``clock_lost``: µs that the
    autopilot's clock has lost in total; ``unanswered``: the autopilot's messages are late, and it does not
    answer whether its clock is the reason; ``error``: distance (m) of the vehicle from its set-points;
    ``nearest``: system id and distance (m) of the nearest neighbour; ``time_trouble``: why fleet time is not
    good enough to make plans; ``refused``: senders whose plans are refused; ``enclosed``: fixed obstacles
    leave no way to the destination.
    """

    now: int
    view: View
    phase: Phase
    vehicle: Vehicle
    holding: Holding
    neighbours: Mapping[int, int]
    failing: int | None
    late: int
    clock_steps: int
    moves: int = 0
    displaced: float = 0.0
    clock_lost: int = 0
    unanswered: bool = False
    error: float = 0.0
    nearest: tuple[int, float] | None = None
    time_trouble: TimeTrouble | None = None
    refused: RefusedSenders = RefusedSenders()
    enclosed: bool = False


class Change(NamedTuple):
    """A concern that began or ended."""

    concern: Concern
    begins: bool


class _ExtendedEvent:
    """Extends a momentary event into a concern of ``_EVENT_DURATION_US`` µs."""

    def __init__(self) -> None:
        self._until = 0

    def after(self, now: int, happens: bool) -> bool:
        """Return whether the event happens now or happened recently."""
        if happens:
            self._until = now + _EVENT_DURATION_US
        return now < self._until


class HealthMonitor:
    """Determines the concerns from the inputs; ``concerns``: the present ones, by name."""

    def __init__(self, config: CompanionConfig) -> None:
        self._config = config
        self.concerns: dict[str, Concern] = {}
        self.blinkered = False
        """Whether a concern about neighbours, positioning, tracking or missed deadlines is present.

        Information on the others or on the own position may then be old or wrong, or the vehicle reacts late.
        """
        self._late, self._clock_set, self._origin_moved = _ExtendedEvent(), _ExtendedEvent(), _ExtendedEvent()
        self._off_setpoints = _ExtendedEvent()
        self._clock_steps = self._moves = 0
        self._lost: deque[tuple[int, int]] = deque()
        self._target_seen = False

    def look(self, s: HealthInputs) -> list[Change]:
        """Return the concerns that began or ended since the last call."""
        found = {concern.name: concern for concern in self._judge(s)}
        changes = [Change(concern, True) for name, concern in found.items() if name not in self.concerns]
        changes += [Change(concern, False) for name, concern in self.concerns.items() if name not in found]
        self.concerns = found
        self.blinkered = not _CAUTION_CONCERNS.isdisjoint(found) or any(
            name.startswith((_NEIGHBOUR_PREFIX, _NEAR_PREFIX)) for name in found
        )
        return changes

    # ``_judge`` collects the concerns; most of the following methods return one, or None.

    def _judge(self, s: HealthInputs) -> list[Concern]:
        found = [
            self._own(s),
            self._positioning(s),
            self._target(s),
            self._solver(s),
            self._battery(s),
            self._autopilot(s),
            self._fence(s),
            self._tracking(s),
            self._near(s),
            self._lateness(s),
            self._clock(s),
            self._slow_clock(s),
            self._late_messages(s),
            self._origin(s),
            self._fleet_time(s),
            self._enclosed(s),
            *self._refused(s),
            *self._others(s),
        ]
        return [concern for concern in found if concern is not None]

    def _own(self, s: HealthInputs) -> Concern | None:
        guard, age = self._config.guard, s.view.own_age
        if s.phase in _ON_THE_GROUND or age <= guard.own_stale_us:
            return None
        lost = age > guard.own_lost_us
        text = "Own position is lost: landing" if lost else "Own position is old: braking"
        return Concern(f"own state {lost}", text, Reaction.LAND if lost else Reaction.TELL)

    def _positioning(self, s: HealthInputs) -> Concern | None:
        trouble = s.vehicle.positioning.trouble
        if not trouble or s.phase in _ON_THE_GROUND:
            return None
        return Concern("positioning", f"{trouble}: dead reckoning", severity=Severity.CRITICAL)

    def _target(self, s: HealthInputs) -> Concern | None:
        if s.view.target is not None:
            self._target_seen = True
            return None
        if not self._target_seen or self._config.task != "escort" or s.phase in _ON_THE_GROUND:
            return None
        return Concern("target", "Target lost: holding")

    def _solver(self, s: HealthInputs) -> Concern | None:
        guard = self._config.guard
        if s.failing is None or s.now - s.failing <= guard.hold_us or s.phase in _ON_THE_GROUND:
            return None
        lost = s.now - s.failing > guard.unsolved_us
        text = "No plan can be found: landing" if lost else "No plan can be found: braking"
        return Concern(f"solver {lost}", text, Reaction.LAND if lost else Reaction.TELL)

    def _battery(self, s: HealthInputs) -> Concern | None:
        guard = self._config.guard
        left = None if s.vehicle.status is None else s.vehicle.status.battery_remaining
        if left is None or left >= guard.battery_low or s.phase in _ON_THE_GROUND:
            return None
        if left < guard.battery_critical:
            return Concern(
                "battery critical", f"Battery {100 * left:.0f} %: landing", Reaction.LAND, Severity.CRITICAL
            )
        return Concern("battery low", f"Battery {100 * left:.0f} %: coming back", Reaction.RETURN)

    def _autopilot(self, s: HealthInputs) -> Concern | None:
        beat = s.vehicle.heartbeat
        if beat is None or s.phase in _ON_THE_GROUND:
            return None
        if not s.vehicle.alive:
            return Concern("heartbeat", "Autopilot is not heard: no set-points")
        if s.phase is Phase.YIELDED:
            return Concern(
                "custody", "Vehicle taken over: no set-points until a go", severity=Severity.NOTICE
            )
        # MAV_STATE_EMERGENCY and higher states also mean a failsafe.
        if beat.system_status >= mavlink.MAV_STATE_CRITICAL:
            return Concern("failsafe", "Autopilot reports a failsafe")
        return None

    def _tracking(self, s: HealthInputs) -> Concern | None:
        alarm = self._config.tracking.alarm
        if alarm is None or s.phase in _ON_THE_GROUND:
            return None
        return (
            Concern("tracking", "Vehicle is beside its set-points: slower")
            if self._off_setpoints.after(s.now, s.error > alarm)
            else None
        )

    def _near(self, s: HealthInputs) -> Concern | None:
        near = self._config.guard.near
        if near is None or s.nearest is None or s.phase in _ON_THE_GROUND or s.nearest[1] >= near:
            return None
        return Concern(f"near {s.nearest[0]}", f"Neighbour {s.nearest[0]} is near: slower")

    def _refused(self, s: HealthInputs) -> list[Concern]:
        refused = s.refused
        kinds = (
            ("doubled", "Two vehicles have id {}: no new plans", refused.doubled),
            ("foreign", "Plans of {} are in another frame", refused.foreign),
            ("differing", "{} has another fleet file or settings", refused.differing),
            ("peer clock", "Clock of {} is wrong: no new plans", refused.wrong_clock),
        )
        return [
            Concern(f"{kind} {system}", text.format(system))
            for kind, text, systems in kinds
            for system in systems
        ]

    def _fence(self, s: HealthInputs) -> Concern | None:
        guard, own = self._config.guard, s.view.own
        if own is None or s.phase in _ON_THE_GROUND:
            return None
        x, y, z = own.position.tolist()
        far = guard.fence_radius is not None and x * x + y * y > guard.fence_radius**2
        high = guard.fence_height is not None and z > guard.fence_height
        if not (far or high):
            return None
        which = "too far from the origin" if far else "too high"
        return Concern("fence", f"Fence: {which}, coming back", Reaction.RETURN, Severity.CRITICAL)

    def _lateness(self, s: HealthInputs) -> Concern | None:
        late = self._late.after(s.now, s.late > self._config.guard.late_us)
        return Concern("lateness", "Deadlines are missed") if late else None

    def _clock(self, s: HealthInputs) -> Concern | None:
        jumped = self._clock_set.after(s.now, s.clock_steps != self._clock_steps)
        self._clock_steps = s.clock_steps
        return Concern("clock", "The autopilot's clock has jumped") if jumped else None

    def _slow_clock(self, s: HealthInputs) -> Concern | None:
        """Return a concern if the autopilot's clock loses more than 1 % of 10 s.

        A present concern ends when the loss is 0.25 % or less.
        """
        lost = self._lost
        lost.append((s.now, s.clock_lost))
        while s.now - lost[0][0] > _CLOCK_PERIOD_US:
            lost.popleft()
        most = _MAX_LOST_SHARE if "slow clock" not in self.concerns else 0.25 * _MAX_LOST_SHARE
        if s.clock_lost - lost[0][1] <= most * _CLOCK_PERIOD_US or s.phase in _ON_THE_GROUND:
            return None
        return Concern("slow clock", "Autopilot's clock is slow: followed")

    def _late_messages(self, s: HealthInputs) -> Concern | None:
        if not s.unanswered or s.phase in _ON_THE_GROUND:
            return None
        return Concern("late messages", "Autopilot is heard late: slow link or clock")

    def _origin(self, s: HealthInputs) -> Concern | None:
        moved = self._origin_moved.after(s.now, s.moves != self._moves)
        self._moves = s.moves
        if not moved or s.phase in _ON_THE_GROUND:
            return None
        if not s.displaced <= self._config.guard.displaced:
            return Concern(
                "origin True", "Own position has jumped: landing", Reaction.LAND, Severity.CRITICAL
            )
        return Concern("origin False", "The autopilot's origin has moved")

    def _fleet_time(self, s: HealthInputs) -> Concern | None:
        if s.time_trouble is None or s.phase in _ON_THE_GROUND:
            return None
        return Concern(f"fleet time {s.time_trouble.name}", s.time_trouble.value)

    def _enclosed(self, s: HealthInputs) -> Concern | None:
        if not s.enclosed or s.phase not in UNDER_WAY:
            return None
        return Concern("enclosed", "No way to the destination past obstacles")

    def _others(self, s: HealthInputs) -> list[Concern]:
        limit = self._config.guard.neighbour_lost_us
        lost = sorted(system for system, age in s.neighbours.items() if age > limit)
        return [
            Concern(f"{_NEIGHBOUR_PREFIX}{system}", f"Neighbour {system} is not heard") for system in lost
        ]


_NEIGHBOUR_PREFIX, _NEAR_PREFIX = "neighbour ", "near "
_CAUTION_CONCERNS = frozenset(("lateness", "positioning", "tracking"))
_ON_THE_GROUND = (Phase.CONNECT, Phase.DONE)
_EVENT_DURATION_US = 5_000_000
"""µs for which a momentary event remains a concern."""
_MAX_LOST_SHARE, _CLOCK_PERIOD_US = 0.01, 10_000_000
"""Lost share of the time above which a clock is slow, and the period (µs) over which it is measured."""
