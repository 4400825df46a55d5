"""Events for the ground: a source of messages has become silent, or has returned."""

from __future__ import annotations

from companion.telemetry.status_text import StatusReporter
from companion.world import World


def report_silence(now: int, world: World, reporter: StatusReporter) -> None:
    """Report target and distance sensors of ``world`` that are silent at ``now`` (µs), and their return."""
    if world.config.task == "escort" and world.target.age(now) is not None:
        reporter.watch(world.target.at(now) is None, "Target lost", "Target is back")
    if world.sensed.proximity is not None:
        silent = world.sensed.proximity.silent(now)
        reporter.watch(silent, "Obstacle sensor silent", "Obstacle sensor is back")
