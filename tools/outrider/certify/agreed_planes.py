"""Planes of agreements: each plan of a vehicle keeps those of all agreements in its lists.

The planes are computed from the two plans of the agreement: for each segment, c points from the peer's plan
to the own one along the shortest line between their hulls, and a control point q of a later own plan
satisfies c·q ≥ c·own − λ max(c·(own − other) − d, 0). λ is (1 − c·m)/2, and m the sum of what both plans
travel from the beginning of the agreement to their ends, divided by the sum of these lengths and 1 m, times
``Terms.shift``. After the last segment both plans and the plane rest.

Two plans that keep one agreement are as far apart as its own two plans, up to d. So the two plans of a later
agreement must not be nearer than those of the one before, or than d.
"""

from __future__ import annotations

from bisect import bisect
from collections import defaultdict
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from companion.avoidance.certified.committed import controls
from companion.avoidance.certified.separating_planes import hull_distance, nearest
from companion.values.horizon import Array
from outrider.certify.evidence import Finding, Terms
from outrider.certify.histories import History, Kind
from outrider.certify.lists import Listing

SLACK = 1e-6
"""Tolerance for floating-point errors (m)."""
_ADDED_M = 1.0
"""Length added to what both plans travel."""


class Kept(NamedTuple):
    """Result: number of pairs of a plan and an agreement that were ``checked``."""

    checked: int
    findings: list[Finding]


class _Breach(NamedTuple):
    """Plans beyond the planes of one agreement: the epoch (µs) of the first, and how far (m) the worst is."""

    epoch: int
    beyond: float


def check(histories: Sequence[History], listings: Sequence[Listing], terms: Terms) -> Kept:
    """Check all plans of ``histories`` against the agreements that their senders list with them."""
    points = _Points(histories, terms)
    by_owner: dict[int, list[Listing]] = defaultdict(list)
    findings: list[Finding] = []
    for one in listings:
        names = (one.owner, one.agreement[0]), (one.peer, one.agreement[1])
        if all(name in points for name in names):
            by_owner[one.owner].append(one)
        else:
            findings.append(_finding("an agreement on a plan that was not sent", one, one.first, ""))
    findings += _weaker(points, histories, [one for found in by_owner.values() for one in found], terms)
    checked = 0
    for history in histories:
        breaches: dict[Listing, _Breach] = {}
        for step in history.steps:
            epoch = step.plan.epoch
            listed = [
                one for one in by_owner[history.system] if max(one.first, *one.agreement) <= epoch <= one.last
            ]
            if not listed:
                continue
            checked += len(listed)
            for one, beyond in zip(
                listed, _beyond(points, history.system, epoch, listed, terms), strict=True
            ):
                if beyond > SLACK:
                    first = breaches.get(one, _Breach(epoch, beyond))
                    breaches[one] = _Breach(first.epoch, max(first.beyond, beyond))
        findings += [
            _finding("a plan beyond agreed planes", one, breach.epoch, f"{breach.beyond:.6f} m")
            for one, breach in breaches.items()
        ]
    return Kept(checked, findings)


def _finding(what: str, one: Listing, time: int, figures: str) -> Finding:
    named = f"on plans of {one.agreement[0]} µs and {one.agreement[1]} µs"
    return Finding(what, (one.owner, one.peer), time, ", ".join(part for part in (figures, named) if part))


def _weaker(
    points: _Points, histories: Sequence[History], listed: Sequence[Listing], terms: Terms
) -> list[Finding]:
    """Return the agreements whose two plans are nearer than those of an earlier one of the pair, and than d.

    An agreement on a plan from before one of the two began anew sets no bound for those after.
    """
    begins = {
        history.system: [step.plan.epoch for step in history.steps if step.kind in (Kind.FIRST, Kind.ANCHOR)]
        for history in histories
    }
    keeps: dict[tuple[int, ...], float] = defaultdict(float)
    findings = []
    for one in listed:
        epoch, (mine, others) = max(one.agreement), one.agreement
        apart = points.later(one.owner, mine, epoch) - points.later(one.peer, others, epoch)
        columns = points.columns(one)
        apart[..., 2] /= terms.downwash
        if terms.upright or columns:
            apart[..., 2] = 0.0
        distance = float(hull_distance(apart).min())
        required = terms.required + columns * terms.further
        if columns and distance < required - SLACK:
            figures = f"{distance:.6f} m, at least {required:.6f} m"
            findings.append(_finding("an agreement too near a column", one, one.first, figures))
        runs = bisect(begins[one.owner], mine), bisect(begins[one.peer], others)
        name = one.owner, one.peer, *runs
        if distance < keeps[name] - SLACK:
            figures = f"{distance:.6f} m, at least {keeps[name]:.6f} m"
            findings.append(_finding("an agreement nearer than the one before", one, one.first, figures))
        else:
            keeps[name] = max(keeps[name], min(distance, terms.required))
    return findings


class _Points:
    """Control points of all plans by vehicle and epoch."""

    def __init__(self, histories: Sequence[History], terms: Terms) -> None:
        self._dt, self._rows = terms.dt, terms.steps + 1
        self._plans = {
            (history.system, step.plan.epoch): step.plan for history in histories for step in history.steps
        }
        self._points: dict[tuple[int, int], Array] = {}

    def __contains__(self, name: tuple[int, int]) -> bool:
        return name in self._plans

    def columns(self, one: Listing) -> int:
        """Return the number of columns among the two plans of an agreement."""
        names = (one.owner, one.agreement[0]), (one.peer, one.agreement[1])
        return sum(self._plans[name].column for name in names)

    def later(self, system: int, begins: int, epoch: int) -> Array:
        """Return control points (rows, 3, 3), m, from ``epoch`` (µs) on, of the plan that ``begins`` (µs)."""
        name = system, begins
        if name not in self._points:
            self._points[name] = controls(self._plans[name])
        points = self._points[name]
        indices = (epoch - begins) // self._dt + np.arange(self._rows)
        result = points[np.minimum(indices, len(points) - 1)]
        result[indices >= len(points)] = points[-1, 2]
        return result


def _beyond(points: _Points, system: int, epoch: int, listed: Sequence[Listing], terms: Terms) -> list[float]:
    """Return how far (m) the plan of ``epoch`` (µs) is beyond the planes of each agreement; ≤ 0 is none."""
    plan = points.later(system, epoch, epoch)
    own = np.stack([points.later(system, one.agreement[0], epoch) for one in listed])
    relative = own - np.stack([points.later(one.peer, one.agreement[1], epoch) for one in listed])
    columns = np.array([points.columns(one) for one in listed])
    # In the plans whose heights are divided by the downwash, distances are Euclidean.
    for points_ in (plan, own, relative):
        points_[..., 2] /= terms.downwash
    relative[(columns > 0) | terms.upright, ..., 2] = 0.0
    normals = nearest(relative.reshape(-1, 3, 3)).reshape(*relative.shape[:2], 1, 3)
    required = (terms.required + columns * terms.further)[:, None, None]
    share = 0.5 - 0.5 * (normals * _motions(points, listed, terms)[:, None, None]).sum(axis=-1)
    room = share * np.maximum((normals * relative).sum(axis=-1) - required, 0.0)
    short: Array = (normals * (own - plan)).sum(axis=-1) - room
    found: list[float] = short.max(axis=(1, 2)).tolist()
    return found


def _motions(points: _Points, listed: Sequence[Listing], terms: Terms) -> Array:
    """Return m (k, 3) of each agreement, in the measure of distances."""
    found = np.empty((len(listed), 3))
    for index, one in enumerate(listed):
        begins = max(one.agreement)
        sides = zip((one.owner, one.peer), one.agreement, strict=True)
        flown = [points.later(system, plan, begins) for system, plan in sides]
        travel = np.array([plan[-1, 2] - plan[0, 0] for plan in flown])
        if terms.upright or points.columns(one):
            travel[:, 2] = 0.0
        found[index] = travel.sum(axis=0) / (np.linalg.norm(travel, axis=1).sum() + _ADDED_M)
    result: Array = terms.shift * found / (1.0, 1.0, terms.downwash)
    return result
