"""What the companions report, and what is said to them. An act is over when those it concerns have reported
all that it leads to."""

from __future__ import annotations

import time
from collections.abc import Iterable
from typing import Any

from outrider.errors import OutriderError
from trials.stage import PATIENCE, Stage

START = 180.0
"""s until all wait for the go: receivers, estimators and clocks take their time."""
GO_AWAITED = "the operator's go"
_AGAIN = 1.0
"""s of the wall after which a go that was not taken is said again."""


class Reports:
    """Waits for events of the companions that come after a mark."""

    def __init__(self, stage: Stage) -> None:
        self._stage = stage
        self._marks = {system: len(wingman.events) for system, wingman in stage.wingmen.items()}

    def of(self, systems: Iterable[int], what: str, text: str, patience: float = PATIENCE) -> None:
        """All of them note it."""
        wanted = list(systems)
        self._stage.until(
            lambda: all(self.noted(system, what, text) for system in wanted),
            f"{what} {text!r} of {', '.join(map(str, wanted))}",
            patience,
        )

    def go(self, systems: Iterable[int]) -> None:
        """Say go to them, again to who was not ready."""
        wanted, asked = list(systems), time.monotonic() - _AGAIN

        def taken() -> bool:
            nonlocal asked
            missing = [system for system in wanted if not self.noted(system, "phase", "prepare")]
            if missing and time.monotonic() - asked >= _AGAIN:
                asked = time.monotonic()
                for system in missing:
                    self._stage.wingmen[system].order("go")
            return not missing

        self._stage.until(taken, f"phase prepare of {wanted}")

    def noted(self, system: int, what: str, text: str) -> bool:
        """Whether it has."""
        return any(event["what"] == what and text in event["text"] for event in self.events(system))

    def last_wait(self, system: int) -> str:
        """What it was waiting for when it last said so."""
        waits = [event["text"] for event in self.events(system) if event["what"] == "waiting"]
        return waits[-1] if waits else "a companion"

    def events(self, system: int) -> list[dict[str, Any]]:
        """Since the mark."""
        return self._stage.wingmen[system].events[self._marks[system] :]


def wait_for_the_go(stage: Stage) -> None:
    """All wait for it, and their truth is known."""
    stage.tell("all get ready")
    reports = Reports(stage)

    def ready() -> bool:
        for system, wingman in stage.wingmen.items():
            if wingman.process.poll() is not None:
                last = wingman.errors.strip().rpartition("\n")[2]
                raise OutriderError(f"the companion of vehicle {system} ended: {last}")
        return all(reports.noted(system, "waiting", GO_AWAITED) for system in stage.plan.systems)

    def wanted() -> str:
        late = [k for k in stage.plan.systems if not reports.noted(k, "waiting", GO_AWAITED)]
        return "; ".join(f"vehicle {k} still waits for {reports.last_wait(k)}" for k in late)

    stage.until(ready, wanted, START)
    stage.until(lambda: stage.observer.ready, lambda: stage.observer.wanted)


def go(stage: Stage, systems: Iterable[int]) -> None:
    """They take off, and escort."""
    stage.tell("go")
    send(Reports(stage), systems)


def send(reports: Reports, systems: Iterable[int]) -> None:
    """The same, within an act."""
    reports.go(systems)
    reports.of(systems, "phase", "escort")


def come_back(stage: Stage) -> None:
    """All return and land."""
    everyone = stage.plan.systems
    stage.tell("all come back")
    reports = Reports(stage)
    stage.walker.stop(stage.observer.clock.now())
    for system in everyone:
        stage.wingmen[system].order("return")
    reports.of(everyone, "phase", "return")
    reports.of(everyone, "phase", "done")
    ended = [wingman.process for wingman in stage.wingmen.values()]
    stage.until(lambda: all(process.poll() is not None for process in ended), "the end of the companions")
    stage.until(lambda: stage.observer.grounded, "disarmed vehicles")
