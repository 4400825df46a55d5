"""Distances of all pairs of plans of one epoch, at every epoch.

They are computed from the hulls of the differences of the control points, so a bound also holds at all times
between the knots.

While the autopilot of one of the two takes it off or lands it, the distance is horizontal, without what each
such vehicle adds to the least distance. A vehicle that lands in a column is checked for ever, at the place
where its last plan ends.

The bound of a pair is the smaller of the required distance and the pair's largest distance so far; the first
distance only sets the bound. After an anchor the bound is suspended until plans of the two in a later epoch
are at least the required distance apart.
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
from outrider.certify.heights import Span, within
from outrider.certify.histories import History, Kind

SLACK = 1e-6
"""Tolerance for floating-point errors (m)."""


class Nearest(NamedTuple):
    """Least distance (m) of checked plans, their vehicles and their epoch (µs)."""

    distance: float
    who: tuple[int, int]
    epoch: int


class Pairs(NamedTuple):
    """Result for all pairs.

    ``checked`` is the number of pairs of plans checked. The others were not, because one of the two had said
    ``farewell`` or the pair was ``resting`` after an anchor. ``epochs`` (µs): all epochs of which a vehicle
    has a plan. ``near`` is the number of pairs of vehicles whose plans were nearer than required when they
    began, or when one of them returned, against assumption (e): they need only come no nearer.
    """

    epochs: tuple[int, ...]
    checked: int
    farewell: int
    resting: int
    near: int
    nearest: Nearest | None
    findings: list[Finding]


class _Pair:
    """Check of the distance between two vehicles' plans, from epoch to epoch."""

    def __init__(self, who: tuple[int, int], required: float) -> None:
        self._who, self._required = who, required
        self._keeps = 0.0
        self._rests = False
        self.near: bool | None = None
        """Whether the first plans that were checked were nearer than required; None before the first."""
        self._breach: tuple[Nearest, int, int] | None = None
        """Worst distance of the current breach, its first epoch (µs) and its number of epochs."""
        self.findings: list[Finding] = []

    def see(self, epoch: int, distance: float, *, anchored: bool) -> bool:
        """Add the distance (m) of the plans of ``epoch`` (µs); return whether it was checked."""
        if anchored:
            self.close()
            self._rests, self._keeps = True, 0.0
            return False
        if self._rests and distance < self._required - SLACK:
            return False
        self._rests = False
        if self.near is None:
            self.near = distance < self._required - SLACK
        if distance < self._keeps - SLACK:
            here = Nearest(distance, self._who, epoch)
            worst, since, count = self._breach or (here, epoch, 0)
            self._breach = min(worst, here), since, count + 1
        else:
            self.close()
            self._keeps = max(self._keeps, min(distance, self._required))
        return True

    def close(self) -> None:
        """End the current breach, if any: it becomes one finding."""
        if self._breach is not None:
            worst, since, count = self._breach
            for_long = (
                f"in {count} epoch{'s' * (count > 1)}, nearest {1e-6 * (worst.epoch - since):.1f} s later"
            )
            figures = f"{worst.distance:.6f} m, at least {self._keeps:.6f} m; {for_long}"
            self.findings.append(Finding("plans nearer than certified", self._who, since, figures))
        self._breach = None


def check(histories: Sequence[History], terms: Terms, spans: Sequence[tuple[Span, ...]] = ()) -> Pairs:
    """Check all pairs of ``histories`` at all epochs.

    ``spans``: for each history, when the vehicle's autopilot decides on its height.
    """
    spans = spans or [()] * len(histories)
    plans = [{step.plan.epoch: step for step in history.steps} for history in histories]
    epochs = tuple(sorted({epoch for sent in plans for epoch in sent}))
    current: dict[int, WirePlan] = {}
    pairs: dict[tuple[int, int], _Pair] = {}
    findings: list[Finding] = []
    checked = farewell = resting = 0
    near: set[tuple[int, int]] = set()
    nearest: Nearest | None = None
    for epoch in epochs:
        anchored = set()
        for k, sent in enumerate(plans):
            step = sent.get(epoch)
            if step is not None:
                current[k] = step.plan
                if step.kind is Kind.ANCHOR:
                    anchored.add(k)
        decides = {k for k in current if within(spans[k], epoch, epoch + terms.epoch)}
        there = [
            k for k in sorted(current) if not histories[k].left(epoch) or (k in decides and current[k].column)
        ]
        together = list(combinations(there, 2))
        farewell += len(current) * (len(current) - 1) // 2 - len(together)
        # A vehicle that returns after a farewell starts anew with all others.
        findings += _concluded(pairs.pop(who) for who in set(pairs).difference(together))
        columns = [(i in decides) + (j in decides) for i, j in together]
        distances = _distances(current, epoch, together, columns, terms)
        for (i, j), distance in zip(together, distances, strict=True):
            who = histories[i].system, histories[j].system
            pair = pairs.setdefault((i, j), _Pair(who, terms.required))
            if not pair.see(epoch, distance, anchored=not anchored.isdisjoint((i, j))):
                resting += 1
                continue
            checked += 1
            if pair.near:
                near.add(who)
            here = Nearest(distance, who, epoch)
            nearest = here if nearest is None else min(nearest, here)
    findings += _concluded(pairs.values())
    return Pairs(epochs, checked, farewell, resting, len(near), nearest, findings)


def _distances(
    current: dict[int, WirePlan],
    epoch: int,
    together: Sequence[tuple[int, int]],
    columns: Sequence[int],
    terms: Terms,
) -> list[float]:
    """Return the least distance (m) of each pair of plans; a silent vehicle's last plan is carried on.

    ``columns``: of how many vehicles of each pair the autopilot decides on the height.
    """
    if not together:
        return []
    goes_on = {
        k: carried_on(current[k], (epoch - current[k].epoch) // terms.dt) for k in set(chain(*together))
    }
    points = {k: controls(plan) for k, plan in goes_on.items()}
    relative: Array = np.stack([points[i] - points[j] for i, j in together])
    relative[..., 2] /= terms.downwash
    count = np.array(columns)
    relative[(count > 0) | terms.upright, ..., 2] = 0.0
    distances = hull_distance(relative.reshape(-1, 3, 3)).reshape(len(together), -1)
    least: list[float] = (distances.min(axis=1) - count * terms.further).tolist()
    return least


def _concluded(pairs: Iterable[_Pair]) -> list[Finding]:
    findings = []
    for pair in pairs:
        pair.close()
        findings += pair.findings
    return findings
