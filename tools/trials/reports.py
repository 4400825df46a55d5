"""Reports of the companions, and orders to them.

An act is over when all companions concerned have reported all its consequences.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from typing import Any

from outrider.errors import OutriderError
from trials.stage import PATIENCE, Stage

START = 180.0
"""Time limit until all wait for the go (s): receivers, estimators and clocks need time."""
GO_AWAITED = "the operator's go"
_AGAIN = 1.0
"""Wall time after which a go that was not accepted is repeated (s)."""


class Reports:
    """Waits for events of the companions that follow a mark, which is set at construction."""

    def __init__(self, stage: Stage) -> None:
        self._stage = stage
        self._marks = {system: len(companion.events) for system, companion in stage.companions.items()}

    def of(self, systems: Iterable[int], what: str, text: str, patience: float = PATIENCE) -> None:
        """Wait until all ``systems`` have recorded an event of kind ``what`` that contains ``text``."""
        wanted = list(systems)
        self._stage.until(
            lambda: all(self.noted(system, what, text) for system in wanted),
            f"{what} {text!r} of {', '.join(map(str, wanted))}",
            patience,
        )

    def go(self, systems: Iterable[int]) -> None:
        """Send a go to ``systems``, repeated to those that were not ready."""
        wanted, asked = list(systems), time.monotonic() - _AGAIN

        def taken() -> bool:
            nonlocal asked
            missing = [system for system in wanted if not self.noted(system, "phase", "prepare")]
            if missing and time.monotonic() - asked >= _AGAIN:
                asked = time.monotonic()
                for system in missing:
                    self._stage.companions[system].order("go")
            return not missing

        self._stage.until(taken, f"phase prepare of {wanted}")

    def noted(self, system: int, what: str, text: str) -> bool:
        """Return whether ``system`` has recorded such an event since the mark."""
        return any(event["what"] == what and text in event["text"] for event in self.events(system))

    def last_wait(self, system: int) -> str:
        """Return what ``system`` waited for in its last report of waiting."""
        waits = [event["text"] for event in self.events(system) if event["what"] == "waiting"]
        return waits[-1] if waits else "a companion"

    def events(self, system: int) -> list[dict[str, Any]]:
        """Return the events of ``system`` since the mark."""
        return self._stage.companions[system].events[self._marks[system] :]


def wait_for_the_go(stage: Stage) -> None:
    """Wait until all companions wait for the go and the true positions are known.

    Raises OutriderError if a companion ends.
    """
    stage.tell("all get ready")
    reports = Reports(stage)

    def ready() -> bool:
        for system, companion in stage.companions.items():
            if companion.process.poll() is not None:
                last = companion.errors.strip().rpartition("\n")[2]
                raise OutriderError(f"the companion of vehicle {system} ended: {last}")
        return all(reports.noted(system, "waiting", GO_AWAITED) for system in stage.plan.systems)

    def wanted() -> str:
        late = [k for k in stage.plan.systems if not reports.noted(k, "waiting", GO_AWAITED)]
        return "; ".join(f"vehicle {k} still waits for {reports.last_wait(k)}" for k in late)

    stage.until(ready, wanted, START)
    stage.until(lambda: stage.observer.ready, lambda: stage.observer.wanted)


def go(stage: Stage, systems: Iterable[int]) -> None:
    """Announce the go; send it to ``systems`` and wait until they escort."""
    stage.tell("go")
    send(Reports(stage), systems)


def send(reports: Reports, systems: Iterable[int]) -> None:
    """Send the go within an act, and wait until ``systems`` escort."""
    reports.go(systems)
    reports.of(systems, "phase", "escort")


def come_back(stage: Stage) -> None:
    """Order all vehicles to return and land, and wait until they have."""
    everyone = stage.plan.systems
    stage.tell("all come back")
    reports = Reports(stage)
    stage.walker.stop(stage.observer.clock.now())
    for system in everyone:
        stage.companions[system].order("return")
    reports.of(everyone, "phase", "return")
    reports.of(everyone, "phase", "done")
    ended = [companion.process for companion in stage.companions.values()]
    stage.until(lambda: all(process.poll() is not None for process in ended), "the end of the companions")
    stage.until(lambda: stage.observer.grounded, "disarmed vehicles")
