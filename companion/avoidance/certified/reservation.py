"""Reservation of a column of air, before the autopilot takes the vehicle off and before it lands it.

On the ground a vehicle is *parked*: it says farewell with a plan that is its column, so that others keep
clear of its place and need nothing of it. When it is to take off it *joins*: it withdraws the farewell, and
climbs once the column is reserved. To land it makes its plan a column, and descends once that is reserved.

The column is reserved when each member has stated an agreement on it, and the own list holds no agreement on
an own plan in space. From the second epoch after that on, the plans that the others fly keep clear of it.
"""

from __future__ import annotations

from math import hypot, inf

from companion.avoidance.certified.agreements import Agreements
from companion.avoidance.certified.column_agreements import ColumnAgreements
from companion.avoidance.certified.commitment import Commitment
from companion.avoidance.certified.committed import rest_time
from companion.config.certified import CertifiedConfig
from companion.values.horizon import Array

_STANDS_M = 0.05
"""Distance (m) from its column at which a vehicle on the ground makes a new one when it joins."""
_MOVED = 0.5
"""Share of the drift, or of the tube, by which it may then be off its column before it makes a new one."""


class Reservation:
    """Reservation of the column of one vehicle; ``columns``: its agreements on columns.

    ``beside`` (m): how far from its column a parked vehicle may report its position. ``joined``: the vehicle
    takes part; otherwise it is parked, or its companion has not begun. ``was_reserved``: the own newest plan
    is a column that has been reserved for long enough, at the last ``watch`` or before.
    """

    def __init__(
        self, config: CertifiedConfig, commitment: Commitment, agreements: Agreements, beside: float
    ) -> None:
        self._config, self._commitment, self._agreements = config, commitment, agreements
        self.columns = ColumnAgreements(agreements)
        self._parks_within = beside
        self._joins_within = _MOVED * max(config.drift, config.tube)
        self._since: int | None = None
        self._in_the_way: set[int] = set()
        self.was_reserved = False
        self.joined = False

    def begin(self, now: int, place: Array, *, joins: bool) -> None:
        """Begin a new column at ``place`` (3,), m, of a vehicle on the ground, unless it still stands there.

        ``joins``: the vehicle is to take off. It does not join where a known plan is too near for an
        agreement, because the other vehicle could then make no plan either. While it waits for that it keeps
        its column, as a parked vehicle does: a column that is begun anew is announced an epoch later.
        """
        commitment, agreements, columns = self._commitment, self._agreements, self.columns
        off = self._off(place)
        within = self._joins_within if self.joined and joins else self._parks_within
        column = None
        self._in_the_way = set()
        if joins and not self.joined and _STANDS_M < off <= within:
            column = commitment.column_at(now, place)
            self._in_the_way = columns.near(column=column)
        if off > within or (column is not None and not self._in_the_way):
            agreements.begin(commitment.begin(now, place, column=True))
            self._since, self.was_reserved = None, False
        newest = commitment.announced()
        if newest is not None:
            agreements.made(newest)
        if self.joined and (not joins or (columns.unreserved() and columns.near())):
            self.joined = False
            self._since, self.was_reserved = None, False
        elif joins and not self.joined and not (self._in_the_way or columns.near()):
            agreements.rejoin()
            # A reservation of the last flight ended with the agreements, at the farewell.
            self._since, self.was_reserved, self.joined = None, False, True

    def _off(self, place: Array) -> float:
        """Return how far (m) ``place`` (3,) is from the axis of the own column; ∞ without a column."""
        newest = self._commitment.announced()
        if newest is None or not newest.column:
            return inf
        x, y, _ = place - newest.position_m
        return hypot(x, y)

    def has_room(self) -> bool:
        """Return whether a vehicle in the air may make its plan a column, or let it be one.

        It may not while a known plan is too near for an agreement: without a column it can move aside. Of two
        columns that are too near, the one of the vehicle with the lower system id stays.
        """
        near = self.columns.near()
        if near and self._commitment.column:
            near -= {system for system in self._agreements.peers.columns if system > self._agreements.own}
        return not near

    def watch(self, now: int, *, listens: bool = False) -> None:
        """Note since when (µs) nothing is missing for the reservation of the newest plan, a column.

        ``listens``: with a range, the companion may have heard too little yet of vehicles within it.
        """
        column = self._commitment.column
        if not column or listens or self.columns.unreserved():
            self._since = None
        elif self._since is None:
            self._since = now
        self.was_reserved = column and (self.was_reserved or self._lasts(now))

    def withdraw(self) -> None:
        """Forget the reservation of a column that was never sent."""
        self._since, self.was_reserved = None, False

    def may_be_left(self) -> bool:
        """Return whether the column may become a plan in space, as far as the members are concerned.

        That is where no agreement is missing. A vehicle that has begun anew since the column was reserved
        was kept away from it by its plan before. It need not agree again, if its newest plan is away as well.
        """
        missing = self._agreements.missing()
        return not missing or (self.was_reserved and self.columns.clear(missing))

    def _lasts(self, now: int) -> bool:
        """Return whether at the last ``watch`` nothing had been missing for long enough at ``now`` (µs).

        A statement that was received since may have taken an agreement back.
        """
        if self._since is None or not self._commitment.column:
            return False
        return now >= self._commitment.epoch(self._since) + 2 * self._config.epoch_us

    def missing(self, now: int) -> str:
        """Return what the autopilot must wait for at ``now`` (µs), or an empty string."""
        if not self._commitment.column:
            return "its column"
        unreserved = self.columns.unreserved()
        if self._lasts(now) and not unreserved:
            horizon = self._commitment.horizon()
            return "" if horizon is None or now >= rest_time(horizon) else "the end of its plan"
        near = self._in_the_way | self.columns.near()
        if near:
            return f"room for its column: the plan of {_listed(near)} is too near"
        return f"the agreement of {_listed(unreserved)} on its column" if unreserved else "its column"


def _listed(systems: set[int]) -> str:
    return ", ".join(map(str, sorted(systems)))
