"""Story of a sortie: the flight in which separation and tracking are measured, act by act."""

from __future__ import annotations

from trials.reports import come_back, go, wait_for_the_go
from trials.stage import Stage
from trials.walker import sortie_target

GO, ESCORT, WALK, RUN, RETURN = "go", "escort", "walk", "run", "return"
"""Marks: the go, all vehicles escort, the target begins to walk, it begins to run, the return."""


def sortie(stage: Stage) -> None:
    """Play all acts. Raises OutriderError if an expected consequence does not occur."""
    wait_for_the_go(stage)
    stage.mark(GO)
    go(stage, stage.plan.systems)
    stage.mark(ESCORT)
    stage.walker.begin(stage.observer.clock.now())
    stage.tell("the target stands")
    for name, pace in zip((WALK, RUN), sortie_target().paces, strict=True):
        stage.wait(stage.marks[ESCORT] + pace.after_s - stage.now)
        stage.mark(name)
        stage.tell(f"the target goes at {pace.speed:g} m/s")
    stage.wait(stage.plan.run_s)
    stage.mark(RETURN)
    come_back(stage)
