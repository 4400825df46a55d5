"""Story of mishaps: an escort that loses its target, companions and links, act by act."""

from __future__ import annotations

from trials.reports import Reports, come_back, go, send, wait_for_the_go
from trials.stage import Stage

KILLED, ENDED = 3, 4
"""Vehicle whose flying process is killed, and vehicle whose companion is killed altogether."""
TARGET_LOST = "Target lost: holding"


def mishaps(stage: Stage) -> None:
    """Play all acts. Raises OutriderError if an expected consequence does not occur."""
    plan, everyone = stage.plan, stage.plan.systems
    wait_for_the_go(stage)
    go(stage, everyone)
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
    come_back(stage)


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
    companion = stage.companions[KILLED]
    stage.tell(f"SIGKILL to the process that flies vehicle {KILLED}")
    reports = Reports(stage)
    companion.kill_pilot()
    reports.of([KILLED], "lost", "the companion is gone")
    # It holds; on a busy machine the autopilot's own time-out may come first.
    reports.of([KILLED], "last word", "the vehicle")
    reports.of([KILLED], "waiting", "the operator's go")
    stage.wait(stage.plan.pause_s)
    send(reports, [KILLED])


def _end_a_companion(stage: Stage) -> None:
    companion = stage.companions[ENDED]
    others = [system for system in stage.plan.systems if system != ENDED]
    silent = f"Neighbour {ENDED} is not heard"
    stage.tell(f"SIGKILL to all of the companion of vehicle {ENDED}")
    reports = Reports(stage)
    companion.kill()
    reports.of(others, "concern", silent)
    stage.tell("it is started anew")
    companion.start()
    reports.of([ENDED], "waiting", "the operator's go")
    reports.of(others, "over", silent)
    send(reports, [ENDED])


def _cut_the_swarm(stage: Stage) -> None:
    everyone = stage.plan.systems
    stage.tell(f"the swarm link is cut for {stage.plan.cut_s:g} s")
    reports = Reports(stage)
    stage.swarm.cut = True
    stage.wait(stage.plan.cut_s)
    stage.swarm.cut = False
    for what in ("concern", "over"):
        for other in everyone:
            received = [system for system in everyone if system != other]
            reports.of(received, what, f"Neighbour {other} is not heard")
