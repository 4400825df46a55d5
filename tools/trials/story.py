"""What happens, act by act. An act is over when those it concerns have reported all that it leads to."""

from __future__ import annotations

import time
from collections.abc import Iterable
from typing import Any

from trials.stage import Stage

KILLED, ENDED = 3, 4
"""Of the one the process that flies is killed; of the other all processes."""
_AGAIN = 1.0
"""s of the wall after which a go that was not taken is said again."""
TARGET_LOST = "Target lost: holding"


class Reports:
    """Waits for events of the companions that come after a mark."""

    def __init__(self, stage: Stage) -> None:
        self._stage = stage
        self._marks = {system: len(wingman.events) for system, wingman in stage.wingmen.items()}

    def of(self, systems: Iterable[int], what: str, text: str) -> None:
        """All of them note it."""
        wanted = list(systems)
        self._stage.until(
            lambda: all(self.noted(system, what, text) for system in wanted),
            f"{what} {text!r} of {', '.join(map(str, wanted))}",
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

    def events(self, system: int) -> list[dict[str, Any]]:
        """Since the mark."""
        return self._stage.wingmen[system].events[self._marks[system] :]


def play(stage: Stage) -> None:
    """All acts. OutriderError if what has to follow does not."""
    plan, everyone = stage.plan, stage.plan.systems
    _wait_for_the_go(stage)
    _escort(stage, everyone)
    stage.tell(f"{plan.escort_s:g} s of escort")
    stage.wait(plan.escort_s)
    _lose_the_target(stage)
    stage.wait(plan.pause_s)
    _kill_the_pilot(stage)
    stage.wait(plan.pause_s)
    _end_a_companion(stage)
    stage.wait(plan.pause_s)
    _cut_the_swarm(stage)
    stage.wait(plan.pause_s)
    _come_back(stage)


def _wait_for_the_go(stage: Stage) -> None:
    stage.tell("all get ready")
    Reports(stage).of(stage.plan.systems, "waiting", "the operator's go")
    stage.until(lambda: stage.observer.ready, "the vehicles' clocks and origins")


def _escort(stage: Stage, systems: Iterable[int]) -> None:
    stage.tell("go")
    _send(Reports(stage), systems)


def _send(reports: Reports, systems: Iterable[int]) -> None:
    reports.go(systems)
    reports.of(systems, "phase", "escort")


def _lose_the_target(stage: Stage) -> None:
    everyone = stage.plan.systems
    stage.tell(f"the target is silent for {stage.plan.blind_s:g} s")
    reports = Reports(stage)
    stage.walker.silent = True
    stage.wait(stage.plan.blind_s)
    reports.of(everyone, "concern", TARGET_LOST)
    stage.walker.silent = False
    reports.of(everyone, "over", TARGET_LOST)


def _kill_the_pilot(stage: Stage) -> None:
    wingman = stage.wingmen[KILLED]
    stage.tell(f"SIGKILL to the process that flies vehicle {KILLED}")
    reports = Reports(stage)
    wingman.kill_pilot()
    reports.of([KILLED], "lost", "the companion is gone")
    # It holds, or its own time-out was quicker on a machine that is busy.
    reports.of([KILLED], "last word", "the vehicle")
    reports.of([KILLED], "waiting", "the operator's go")
    stage.wait(stage.plan.pause_s)
    _send(reports, [KILLED])


def _end_a_companion(stage: Stage) -> None:
    wingman = stage.wingmen[ENDED]
    others = [system for system in stage.plan.systems if system != ENDED]
    silent = f"Neighbour {ENDED} is not heard"
    stage.tell(f"SIGKILL to all of the companion of vehicle {ENDED}")
    reports = Reports(stage)
    wingman.kill()
    reports.of(others, "concern", silent)
    stage.tell("it is started anew")
    wingman.start()
    reports.of([ENDED], "waiting", "the operator's go")
    reports.of(others, "over", silent)
    _send(reports, [ENDED])


def _cut_the_swarm(stage: Stage) -> None:
    everyone = stage.plan.systems
    stage.tell(f"the swarm link is cut for {stage.plan.cut_s:g} s")
    reports = Reports(stage)
    stage.swarm.cut = True
    stage.wait(stage.plan.cut_s)
    stage.swarm.cut = False
    for what in ("concern", "over"):
        for other in everyone:
            heard = [system for system in everyone if system != other]
            reports.of(heard, what, f"Neighbour {other} is not heard")


def _come_back(stage: Stage) -> None:
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
    stage.until(lambda: all(one.armed is False for one in stage.observer.seen.values()), "disarmed vehicles")
