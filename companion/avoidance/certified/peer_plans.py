"""What each knows of the others' committed plans, and whom it counts with.

Plans are filed by the epoch they begin at. A vehicle replans in an epoch only if it holds the plan of that
very epoch of everybody it counts with, and each of them counts with it in that epoch (``missing`` is empty):
an older plan will not do, for its sender may have made another since. Who was once heard with a plan or a
roster counts from then on, and so does whoever one of those counts with; who has said farewell flies its last
plan to the end and stays there. That is believed only with the very plan that the farewell goes with, for an
older one may end elsewhere; and only for as long as plans are, for its sender may have joined again since.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

from companion.avoidance.certified.committed import carried_on, controls, rests
from companion.values.horizon import Array
from mavlink_bridge.errors import PlanWireError
from mavlink_bridge.wire.plan import WirePlan, unpack
from mavlink_bridge.wire.roster import Roster

_KEPT = 4
"""Epochs of a sender that are kept; nothing that is older or further ahead is believed."""


class Filed(NamedTuple):
    """A plan with its control points (n, 3, 3), m."""

    plan: WirePlan
    controls: Array


@lru_cache(maxsize=512)
def _read(payload: bytes) -> tuple[Filed, bool]:
    """A plan on the wire, and whether it ends at rest. Where many companions share a process each is read
    once. Raises PlanWireError."""
    plan = unpack(payload)
    points = controls(plan)
    points.flags.writeable = False
    return Filed(plan, points), rests(plan)


class PeerPlans:
    """Plans and rosters of the others. ``expected``: system ids that are to take part, heard or not.
    ``steps`` and ``dt`` (µs) are everybody's; ``epoch`` (µs) is a whole number of dt."""

    def __init__(
        self, own: int, expected: frozenset[int], steps: int, dt: int, epoch: int, origin: int
    ) -> None:
        self._own = own
        self._expected = expected - {own}
        self._steps, self._dt, self._epoch, self._origin = steps, dt, epoch, origin
        self._plans: dict[int, dict[int, Filed]] = {}
        self._rosters: dict[int, Roster] = {}
        # From which epoch (µs) on each counts with us, and which rosters (µs) tell of it at the earliest.
        self._counted: dict[int, int] = {}
        self._telling = 0
        self._left: dict[int, Filed] = {}
        self._last: dict[int, bytes] = {}
        self._members: frozenset[int] | None = None
        self.refused = 0

    @property
    def members(self) -> frozenset[int]:
        """Everybody that is counted with."""
        if self._members is None:
            named = (roster.members for roster in self._rosters.values())
            known = self._expected.union(self._plans, self._rosters, *named)
            self._members = known - {self._own} - set(self._left)
        return self._members

    def receive_plan(self, now: int, system: int, payload: bytes) -> None:
        """A TUNNEL payload of kind plan; one that cannot be a committed plan is refused and counted."""
        # Most are told again what they hold.
        if system == self._own or self._last.get(system) == payload:
            return
        try:
            read, at_rest = _read(payload)
        except PlanWireError:
            self.refused += 1
            return
        plan = read.plan
        fits = (
            at_rest
            and plan.origin == self._origin
            and plan.dt == self._dt
            and len(plan.accelerations) == self._steps
            and plan.epoch % self._epoch == 0
            and abs(plan.epoch - now) <= _KEPT * self._epoch
        )
        filed = self._plans.setdefault(system, {}) if fits else {}
        known = filed.get(plan.epoch)
        if not fits or (known is not None and known.plan != plan):
            self.refused += 1
            return
        self._last[system] = payload
        if not filed:
            self._members = None
        if known is None:
            filed[plan.epoch] = read
            for epoch in sorted(filed)[:-_KEPT]:
                del filed[epoch]

    def receive_roster(self, now: int, system: int, roster: Roster) -> None:
        """Whom a member counts with. A farewell says that its plan of that epoch is its last; whoever has
        not got that plan yet, or is not in that epoch yet, hears it again. One that comes late says nothing:
        who joined again since makes plans."""
        if system == self._own:
            return
        if roster.epoch - now > _KEPT * self._epoch:
            # By a clock that will be set right: what is said then would come too early.
            self.refused += 1
            return
        last = self._rosters.get(system)
        if last is not None and roster.epoch < last.epoch:
            return
        left = self._left.get(system)
        if left is not None and roster.epoch <= left.plan.epoch:
            return
        if roster.farewell:
            filed = self._plans.get(system, {}).get(roster.epoch)
            if filed is not None and 0 <= now - roster.epoch <= _KEPT * self._epoch:
                self._left[system] = filed
                self._counted.pop(system, None)
                self._members = None
            return
        self._left.pop(system, None)
        if self._own not in roster.members:
            self._counted.pop(system, None)
        elif roster.epoch >= self._telling:
            self._counted.setdefault(system, roster.epoch)
        if last is None or left is not None or roster.members != last.members:
            self._members = None
        self._rosters[system] = roster

    def leave(self, epoch: int) -> None:
        """Farewell is said with the own plan of ``epoch`` (µs): who believes it counts with us no more. So
        nobody is taken to, until it tells so when it can no longer come to believe it. A roster goes with a
        plan that begins at most two epochs later."""
        self._counted.clear()
        self._telling = epoch + (_KEPT + 3) * self._epoch

    def missing(self, epoch: int) -> set[int]:
        """Members whose plan of ``epoch`` (µs) is not held, or who may replan in it without counting with us:
        whoever says so only with a later plan may have made that plan before it counted with us."""
        found = set()
        for system in self.members:
            counted = self._counted.get(system)
            if epoch not in self._plans.get(system, {}) or counted is None or counted > epoch:
                found.add(system)
        return found

    def plans(self, epoch: int) -> dict[int, Filed]:
        """Plans of ``epoch`` (µs), that of now, by system id: of members and of those who left."""
        found = {system: filed[epoch] for system, filed in self._plans.items() if epoch in filed}
        for system, last in self._left.items():
            plan = carried_on(last.plan, (epoch - last.plan.epoch) // self._dt)
            found[system] = Filed(plan, controls(plan))
        return dict(sorted(found.items()))

    @property
    def left(self) -> dict[int, Filed]:
        """The last plans of those who said farewell."""
        return dict(self._left)
