"""What the vehicles of a swarm flew and agreed on, and the laws that it obeys."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from companion.avoidance.certified.committed import carried_on, controls
from companion.avoidance.certified.margins import between, further
from companion.avoidance.certified.pair import Agreement
from companion.avoidance.certified.separating_planes import hull_distance, nearest
from companion.config import CompanionConfig
from mavlink_bridge.wire.plan import WirePlan, pack
from tests.companion.avoidance.certified.plans import EPOCH, curves
from tests.companion.avoidance.certified.vehicle import Made, Vehicle

EXACT = 1e-9
"""m."""


class Kept(NamedTuple):
    """That ``system`` keeps ``agreement`` with ``other`` with its plan of ``epoch`` (µs)."""

    system: int
    other: int
    agreement: Agreement
    epoch: int


class Flown:
    """Of ``vehicles`` with the settings ``config``, recorded step by step by ``record``."""

    def __init__(self, config: CompanionConfig, vehicles: Sequence[Vehicle]) -> None:
        self.config, self.vehicles = config, vehicles
        self.d = between(config.certified, config.field, config.limits)
        self._further = further(config.certified)
        self.sent: list[bytes] = []
        self.parted: list[tuple[int, int, int]] = []
        """When (µs of the run) which two vehicles may plan without an agreement that both keep."""
        self.kept: set[Kept] = set()
        self.misled: list[tuple[int, int, int]] = []
        """When (µs of the run) who flies beside whose last plan although that has made another."""
        self.mistaken: list[Kept] = []
        """Agreements of which somebody holds other plans than those that are flown."""

    def record(self, since: int, one: Vehicle) -> None:
        """What ``one`` flies and keeps after its step at ``since`` (µs of the run)."""
        self._check_plans(since, one)
        self._check_agreements(since, one)

    def _check_plans(self, since: int, one: Vehicle) -> None:
        newest = one.flight.commitment.announced()
        if newest is None or not one.plans:
            return
        if not one.habits.leaves <= since < one.habits.returns:
            left = one.flight.agreements.peers.left.items()
            self.misled += [(since, one.system, s) for s, last in left if self._flies_another(s, last.plan)]
        for system, agreement, plans in one.keeps():
            kept = Kept(one.system, system, agreement, newest.epoch)
            if kept in self.kept:
                continue
            self.kept.add(kept)
            true = one.held(agreement.own), self.vehicles[system - 1].held(agreement.other)
            if (plans.own.plan, plans.other.plan) != true:
                self.mistaken.append(kept)

    def _check_agreements(self, since: int, one: Vehicle) -> None:
        own = one.flight.agreements.kept()
        for other in self.vehicles:
            theirs = other.flight.agreements.kept().get(one.system, ())
            mine = own.get(other.system, ())
            both = {a for a in mine if Agreement(a.other, a.own) in theirs}
            if one.confirmed(other.system) and other.confirmed(one.system) and not both:
                self.parted.append((since, one.system, other.system))

    def epochs(self) -> range:
        """All that anybody flew in."""
        step = self.config.certified.epoch_us
        known = [EPOCH, *(epoch for vehicle in self.vehicles for epoch in vehicle.plans)]
        return range(min(known), max(known) + 1, step)

    def least(self) -> float:
        """The least distance (m) of any two plans as they are flown, by hulls and by places along them.

        The distance is horizontal where autopilots decide on heights, and what is added for each such vehicle
        is not counted.
        """
        length = self.config.certified.epoch_us
        steps = length // self.config.certified.dt_us
        least = np.inf
        for epoch in self.epochs():
            since = epoch - EPOCH
            flown = [
                (vehicle.in_column(since, since + length), controls(vehicle.plan(epoch))[:steps])
                for vehicle in self.vehicles
            ]
            together = list(combinations(flown, 2))
            pairs = np.stack([one - other for (_, one), (_, other) in together])
            columns = np.array([one + other for (one, _), (other, _) in together])
            pairs[columns > 0, ..., 2] = 0.0
            more = np.repeat(self._further * columns, steps)
            pairs = pairs.reshape(-1, 3, 3)
            least = min(least, (hull_distance(pairs) - more).min())
            least = min(least, (np.linalg.norm(curves(pairs), axis=-1).min(axis=-1) - more).min())
        return float(least)

    def beside(self) -> int:
        """In how many epochs a vehicle flies another plan than its backup node, while its step lasts."""
        return sum(
            vehicle.plan(epoch) != carried_on(before, (epoch - before.epoch) // before.dt)
            for vehicle in self.vehicles
            for since, until, before in vehicle.stalled
            if before is not None
            for epoch in self.epochs()
            if max(since, before.epoch - EPOCH) < epoch - EPOCH <= until
        )

    def unflagged(self) -> bool:
        """Whether an autopilot decides on a height in an epoch whose plan is no column."""
        length = self.config.certified.epoch_us
        return any(
            vehicle.in_column(epoch - EPOCH, epoch - EPOCH + length) and not vehicle.plan(epoch).column
            for vehicle in self.vehicles
            for epoch in self.epochs()
        )

    def crossed(self) -> float:
        """By how much (m) plans cross the planes of agreements that are kept, at most; negative if none does.

        The planes are worked out anew from what is flown, by NumPy.
        """
        return max((self._crossed(kept) for kept in self.kept), default=-np.inf)

    def _crossed(self, kept: Kept) -> float:
        one, two = self.vehicles[kept.system - 1], self.vehicles[kept.other - 1]
        newest, own, other = (
            controls(carried_on(plan, (kept.epoch - plan.epoch) // plan.dt))
            for plan in (
                one.plans[kept.epoch],
                one.plans[kept.agreement.own],
                two.plans[kept.agreement.other],
            )
        )
        relative = own - other
        begins, travel = max(kept.agreement), np.zeros((2, 3))
        plans = one.plans[kept.agreement.own], two.plans[kept.agreement.other]
        for side, plan in enumerate(plans):
            points = controls(carried_on(plan, (begins - plan.epoch) // plan.dt))
            travel[side] = points[-1, 2] - points[0, 0]
        columns = sum(plan.column for plan in plans)
        if columns:
            relative[..., 2] = travel[:, 2] = 0.0
        motion = travel.sum(axis=0) / (1.0 + np.linalg.norm(travel, axis=1).sum())
        normals = nearest(relative)
        share = 0.5 * (1.0 - self.config.plane_shift * normals @ motion)[:, None]
        gap = np.minimum(self.d + columns * self._further, np.einsum("nk,nik->ni", normals, relative))
        least = np.einsum("nk,nik->ni", normals, own) - share * (
            np.einsum("nk,nik->ni", normals, relative) - gap
        )
        return float((least - np.einsum("nk,nik->ni", normals, newest)).max())

    @property
    def exact(self) -> float:
        """How exactly (m) distances are kept: two plans of an agreement on a column by 1 µm."""
        return EXACT + 1e-6 * any(vehicle.columns for vehicle in self.vehicles)

    def abandoned(self) -> list[Made]:
        """Plans that were made beside an agreement with another that is known to have begun anew since."""
        return [
            made
            for made in self.made()
            if any(one.other < made.begun.get(s, 0) for s, kept in made.beside.items() for one in kept)
        ]

    def _flies_another(self, system: int, last: WirePlan) -> bool:
        """Whether the newest plan of ``system`` is not ``last``, carried on."""
        vehicle = self.vehicles[system - 1]
        at = max(last.epoch, *vehicle.plans)
        return vehicle.plan(at) != carried_on(last, (at - last.epoch) // last.dt)

    def faults(self) -> list[str]:
        """What breaks the theorem, or a law that it follows from, in this run; each by its name."""
        found = {
            "separation": self.least() < self.d - self.exact,
            "a height without a column": self.unflagged(),
            "a height beside slanted planes": any(vehicle.slanted for vehicle in self.vehicles),
            "no agreement in common": bool(self.parted),
            "other plans than those that are flown": bool(self.mistaken),
            "a plan crosses a plane": self.crossed() > EXACT,
            "a plan beside an abandoned one": bool(self.abandoned()),
            "a last plan that is not flown on": bool(self.misled),
            "another plan than that of the backup node": bool(self.beside()),
            "two plans of an epoch": any(vehicle.contradictions for vehicle in self.vehicles),
        }
        return [name for name, broken in found.items() if broken]

    def made(self) -> list[Made]:
        """By all, each in its own order."""
        return [made for vehicle in self.vehicles for made in vehicle.made]

    def digest(self) -> bytes:
        """All that was flown and told."""
        flown = [pack(vehicle.plan(epoch)) for vehicle in self.vehicles for epoch in self.epochs()]
        return b"".join(flown + self.sent)
