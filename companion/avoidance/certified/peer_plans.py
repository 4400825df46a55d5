"""Peers' committed plans, filed by the epoch at which they begin, and the coordination set.

A vehicle replans in an epoch only if it holds the plan of that very epoch of every member of its coordination
set, and each of these has this vehicle in its own coordination set (``missing`` is empty). An older plan is
not enough, because its sender may have made another since. Members are the expected vehicles, the senders of
plans or rosters, and the vehicles in the latest roster of each sender, all until their farewell. A vehicle
that said farewell flies its last plan to the end and stays there. A farewell is accepted only if the plan of
its epoch is held, because an older plan may end elsewhere; and only until four epochs (``_MAX_EPOCHS``) after
the beginning of its epoch, because its sender may have joined again since.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

from companion.avoidance.certified.committed import carried_on, controls, rests
from companion.values.horizon import Array
from mavlink_bridge.errors import PlanWireError
from mavlink_bridge.wire.plan import WirePlan, unpack
from mavlink_bridge.wire.roster import Roster

_MAX_EPOCHS = 4
"""Number of epochs of a sender that are kept; plans further from now, older or ahead, are refused."""


class StoredPlan(NamedTuple):
    """Plan with its control points (n, 3, 3), m."""

    plan: WirePlan
    controls: Array


@lru_cache(maxsize=512)
def _read(payload: bytes) -> tuple[StoredPlan, bool]:
    """Return a received plan, and whether it ends at rest; raises PlanWireError.

    If many companions share a process, each payload is decoded once.
    """
    plan = unpack(payload)
    points = controls(plan)
    points.flags.writeable = False
    return StoredPlan(plan, points), rests(plan)


class PeerPlans:
    """Plans and rosters of the peers.

    ``expected``: system ids that must take part, received or not. ``steps`` and ``dt`` (µs) are those of all
    vehicles; ``epoch`` (µs) is a whole number of dt.
    """

    def __init__(
        self, own: int, expected: frozenset[int], steps: int, dt: int, epoch: int, origin: int
    ) -> None:
        self._own = own
        self._expected = expected - {own}
        self._steps, self._dt, self._epoch, self._origin = steps, dt, epoch, origin
        self._plans: dict[int, dict[int, StoredPlan]] = {}
        self._rosters: dict[int, Roster] = {}
        # Epoch (µs) from which on each peer has this vehicle in its coordination set, and the earliest epoch
        # (µs) of rosters from which this is learnt.
        self._counted: dict[int, int] = {}
        self._earliest_counted_epoch = 0
        self._left: dict[int, StoredPlan] = {}
        self._last: dict[int, bytes] = {}
        self._members: frozenset[int] | None = None
        self.refused = 0

    @property
    def members(self) -> frozenset[int]:
        """System ids of the coordination set."""
        if self._members is None:
            named = (roster.members for roster in self._rosters.values())
            known = self._expected.union(self._plans, self._rosters, *named)
            self._members = known - {self._own} - set(self._left)
        return self._members

    def receive_plan(self, now: int, system: int, payload: bytes) -> None:
        """Receive a TUNNEL payload of kind plan.

        Refuses and counts a plan that cannot be decoded, does not end at rest, differs from this vehicle's
        settings (frame, dt, steps, epoch), is too far from ``now``, or differs from the stored plan of its
        epoch.
        """
        # Most payloads repeat the last one.
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
            and abs(plan.epoch - now) <= _MAX_EPOCHS * self._epoch
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
            for epoch in sorted(filed)[:-_MAX_EPOCHS]:
                del filed[epoch]

    def receive_roster(self, now: int, system: int, roster: Roster) -> None:
        """Receive a roster: the coordination set of ``system``, or its farewell.

        A farewell means that the sender's plan of that epoch is its last. It is repeated for receivers that
        do not hold that plan yet or are not in that epoch yet. A late farewell has no effect, because its
        sender may have joined again since, and then makes plans.
        """
        if system == self._own:
            return
        if roster.epoch - now > _MAX_EPOCHS * self._epoch:
            # The sender's clock is ahead. Once it is corrected, its rosters would have earlier epochs than
            # this one and be ignored.
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
            if filed is not None and 0 <= now - roster.epoch <= _MAX_EPOCHS * self._epoch:
                self._left[system] = filed
                self._counted.pop(system, None)
                self._members = None
            return
        self._left.pop(system, None)
        if self._own not in roster.members:
            self._counted.pop(system, None)
        elif roster.epoch >= self._earliest_counted_epoch:
            self._counted.setdefault(system, roster.epoch)
        if last is None or left is not None or roster.members != last.members:
            self._members = None
        self._rosters[system] = roster

    def leave(self, epoch: int) -> None:
        """Record the own farewell with the own plan of ``epoch`` (µs).

        A peer that accepts the farewell no longer counts this vehicle. So a peer is assumed to count it again
        only after a roster of that peer says so and is too late for the peer to accept the farewell
        afterwards: the farewell is accepted for four epochs, a roster's plan begins at most two epochs after
        it is sent, and one epoch is a margin.
        """
        self._counted.clear()
        self._earliest_counted_epoch = epoch + (_MAX_EPOCHS + 3) * self._epoch

    def missing(self, epoch: int) -> set[int]:
        """Return the members that keep this vehicle from replanning in ``epoch`` (µs).

        The plan of such a member for this epoch is not held, or the member may replan without regard to this
        vehicle, because none of its rosters for this epoch or an earlier one contains this vehicle, or a
        later one omits it.
        """
        found = set()
        for system in self.members:
            counted = self._counted.get(system)
            if epoch not in self._plans.get(system, {}) or counted is None or counted > epoch:
                found.add(system)
        return found

    def plans(self, epoch: int) -> dict[int, StoredPlan]:
        """Return the plans of the present ``epoch`` (µs) by system id; departed vehicles are included."""
        found = {system: filed[epoch] for system, filed in self._plans.items() if epoch in filed}
        for system, last in self._left.items():
            plan = carried_on(last.plan, (epoch - last.plan.epoch) // self._dt)
            found[system] = StoredPlan(plan, controls(plan))
        return dict(sorted(found.items()))

    @property
    def left(self) -> dict[int, StoredPlan]:
        """Last plans of the vehicles that said farewell, by system id."""
        return dict(self._left)
