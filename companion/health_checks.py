"""Health checks of one companion: concerns, their reports to the ground, and reactions to them."""

from __future__ import annotations

import numpy as np

from companion.avoidance.certified.fleet_clock import FleetClock
from companion.config import CompanionConfig
from companion.estimation.time_sync import RoundTrips
from companion.flight.health_monitor import Change, HealthInputs, HealthMonitor, Reaction
from companion.flight.state_machine import Pilot
from companion.goals.goals import Goals
from companion.planning.avoidance import Avoidance
from companion.telemetry.status_text import Severity, StatusReporter
from companion.values.phase import STEERED
from companion.world import View, World

_PERIOD_US = 100_000
"""Least time between two health checks."""
_TO_ASCII = str.maketrans({"²": "2", "³": "3", "°": "deg"})
"""Replacements for STATUSTEXT, which is ASCII."""


class Reactions:
    """Pending reactions to present concerns; a reaction already ordered continues when its concern ends."""

    def __init__(self) -> None:
        self._pending: dict[str, Reaction] = {}

    def note(self, change: Change) -> None:
        """Record a concern that began or ended."""
        concern = change.concern
        if not change.begins:
            self._pending.pop(concern.name, None)
        elif concern.reaction is not Reaction.TELL:
            self._pending[concern.name] = concern.reaction

    def follow(self, pilot: Pilot) -> None:
        """Order the most severe pending reaction while set-points steer the vehicle, and clear all.

        If the concern began during the take-off, or while another controller had the vehicle, its reaction
        waits until the companion steers.
        """
        if not self._pending or pilot.phase not in STEERED:
            return
        if Reaction.LAND in self._pending.values():
            pilot.alight()
        else:
            pilot.come_back()
        self._pending.clear()


class HealthChecks:
    """Health checks of the vehicle of ``pilot``, about every 100 ms.

    ``reporter`` reports concerns and changes of the autopilot's limits. ``fleet_clock``: None where fleet
    time is not measured.
    """

    def __init__(
        self,
        config: CompanionConfig,
        world: World,
        pilot: Pilot,
        avoidance: Avoidance,
        round_trips: RoundTrips,
        reporter: StatusReporter,
        fleet_clock: FleetClock | None,
        goals: Goals,
    ) -> None:
        self._fleet_clock, self._goals = fleet_clock, goals
        self._world, self._pilot, self._avoidance = world, pilot, avoidance
        self._round_trips, self._reporter = round_trips, reporter
        self.monitor = HealthMonitor(config)
        self._reactions = Reactions()
        self._next = self._largest_delay = self._reported = 0

    def start(self, now: int) -> None:
        """Start the checks at ``now`` (µs)."""
        self._next = now

    def step(self, now: int, view: View, late: int) -> None:
        """Run the checks if they are due.

        ``late``: time (µs) since the next set-point was due; negative before.
        """
        self._largest_delay = max(self._largest_delay, late)
        if now < self._next:
            return
        self._next = now + _PERIOD_US
        for change in self.monitor.look(self._inputs(now, view)):
            concern = change.concern
            if concern.name != "target":  # ``report_silence`` reports the target
                self._reporter.report(concern.severity, concern.text, begins=change.begins)
            self._reactions.note(change)
        self._largest_delay = 0
        self._reactions.follow(self._pilot)
        self._report_limits()

    def _inputs(self, now: int, view: View) -> HealthInputs:
        """Return the inputs of the health monitor at ``now`` (µs)."""
        world, pilot, avoidance = self._world, self._pilot, self._avoidance
        world.neighbours.listen(now, view.own)
        return HealthInputs(
            now,
            view,
            pilot.phase,
            pilot.vehicle,
            avoidance.state,
            world.neighbours.ages(now),
            avoidance.failing,
            self._largest_delay if pilot.streaming else 0,
            world.clock_steps,
            world.moves,
            world.displaced,
            world.clock_lost,
            self._round_trips.unanswered(now),
            float(np.linalg.norm(avoidance.tracking.error)) if pilot.streaming else 0.0,
            world.neighbours.nearest(now, view.own),
            None if self._fleet_clock is None else self._fleet_clock.trouble,
            avoidance.refused(now),
            self._goals.enclosed or avoidance.enclosed,
        )

    def _report_limits(self) -> None:
        """Report changes of the autopilot's limits to the ground."""
        limits = self._pilot.limits
        new = min(limits.said - self._reported, len(limits.remarks))
        for text in list(limits.remarks)[len(limits.remarks) - new :]:
            self._reporter.say(Severity.WARNING, text.translate(_TO_ASCII))
        self._reported = limits.said


def report_silence(now: int, world: World, reporter: StatusReporter) -> None:
    """Report target and distance sensors of ``world`` that are silent at ``now`` (µs), and their return."""
    if world.config.task == "escort" and world.target.age(now) is not None:
        reporter.watch(world.target.at(now) is None, "Target lost", "Target is back")
    if world.sensed.proximity is not None:
        silent = world.sensed.proximity.silent(now)
        reporter.watch(silent, "Obstacle sensor silent", "Obstacle sensor is back")
