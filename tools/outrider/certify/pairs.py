"""All pairs of plans of one epoch, at every epoch: by the hulls of the differences of their control points,
so that what holds, holds at all times between the knots too.

A pair has to stay as far apart as is required, or as it ever was if that is less. It begins as it is. After
an anchor its promise rests until a later plan of each is as far from the other's as is required.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import chain, combinations
from typing import NamedTuple

import numpy as np

from companion.avoidance.certified.committed import carried_on, controls
from companion.avoidance.certified.separating_planes import hull_distance
from companion.values.horizon import Array
from mavlink_bridge.wire.plan import WirePlan
from outrider.certify.evidence import Finding, Terms
from outrider.certify.histories import History, Kind

SLACK = 1e-6
"""m: what floating point may cost."""


class Nearest(NamedTuple):
    """The least distance (m) of plans that were checked, whose, and of which epoch (µs)."""

    distance: float
    who: tuple[int, int]
    epoch: int


class Pairs(NamedTuple):
    """How many pairs of plans were ``checked``, and how many not, because one of the two had said farewell or
    was ``resting`` after an anchor. ``epochs`` (µs): all that somebody has a plan of."""

    epochs: tuple[int, ...]
    checked: int
    farewell: int
    resting: int
    nearest: Nearest | None
    findings: list[Finding]


class _Pair:
    """What two vehicles have to keep, from epoch to epoch."""

    def __init__(self, who: tuple[int, int], required: float) -> None:
        self._who, self._required = who, required
        self._keeps = 0.0
        self._rests = False
        self._breach: tuple[Nearest, int, int] | None = None
        """The worst, since when (µs), in how many epochs."""
        self.findings: list[Finding] = []

    def see(self, epoch: int, distance: float, *, anchored: bool) -> bool:
        """Their plans of ``epoch`` (µs) are ``distance`` (m) apart; whether that was checked."""
        if anchored:
            self.close()
            self._rests, self._keeps = True, 0.0
            return False
        if self._rests and distance < self._required - SLACK:
            return False
        self._rests = False
        if distance < self._keeps - SLACK:
            here = Nearest(distance, self._who, epoch)
            worst, since, count = self._breach or (here, epoch, 0)
            self._breach = min(worst, here), since, count + 1
        else:
            self.close()
            self._keeps = max(self._keeps, min(distance, self._required))
        return True

    def close(self) -> None:
        """What was too near is so no longer, or is not looked at any more: one finding for all of it."""
        if self._breach is not None:
            worst, since, count = self._breach
            for_long = (
                f"in {count} epoch{'s' * (count > 1)}, nearest {1e-6 * (worst.epoch - since):.1f} s later"
            )
            figures = f"{worst.distance:.6f} m, at least {self._keeps:.6f} m; {for_long}"
            self.findings.append(Finding("plans nearer than certified", self._who, since, figures))
        self._breach = None


def check(histories: Sequence[History], terms: Terms) -> Pairs:
    """All pairs of ``histories`` at all epochs."""
    plans = [{step.plan.epoch: step for step in history.steps} for history in histories]
    epochs = tuple(sorted({epoch for told in plans for epoch in told}))
    current: dict[int, WirePlan] = {}
    pairs: dict[tuple[int, int], _Pair] = {}
    findings: list[Finding] = []
    checked = farewell = resting = 0
    nearest: Nearest | None = None
    for epoch in epochs:
        anchored = set()
        for k, told in enumerate(plans):
            step = told.get(epoch)
            if step is not None:
                current[k] = step.plan
                if step.kind is Kind.ANCHOR:
                    anchored.add(k)
        there = [k for k in sorted(current) if not histories[k].left(epoch)]
        together = list(combinations(there, 2))
        farewell += len(current) * (len(current) - 1) // 2 - len(together)
        # Who comes back after a farewell begins anew with everybody.
        findings += _concluded(pairs.pop(who) for who in set(pairs).difference(together))
        for (i, j), distance in zip(together, _distances(current, epoch, together, terms), strict=True):
            who = histories[i].system, histories[j].system
            pair = pairs.setdefault((i, j), _Pair(who, terms.required))
            if not pair.see(epoch, distance, anchored=not anchored.isdisjoint((i, j))):
                resting += 1
                continue
            checked += 1
            here = Nearest(distance, who, epoch)
            nearest = here if nearest is None else min(nearest, here)
    findings += _concluded(pairs.values())
    return Pairs(epochs, checked, farewell, resting, nearest, findings)


def _distances(
    current: dict[int, WirePlan], epoch: int, together: Sequence[tuple[int, int]], terms: Terms
) -> list[float]:
    """Least distance (m) of each pair of plans; who is silent carries its last one on."""
    if not together:
        return []
    goes_on = {
        k: carried_on(current[k], (epoch - current[k].epoch) // terms.dt) for k in set(chain(*together))
    }
    points = {k: controls(plan) for k, plan in goes_on.items()}
    relative: Array = np.stack([points[i] - points[j] for i, j in together])
    if terms.upright:
        relative[..., 2] = 0.0
    distances = hull_distance(relative.reshape(-1, 3, 3)).reshape(len(together), -1)
    least: list[float] = distances.min(axis=1).tolist()
    return least


def _concluded(pairs: Iterable[_Pair]) -> list[Finding]:
    findings = []
    for pair in pairs:
        pair.close()
        findings += pair.findings
    return findings
