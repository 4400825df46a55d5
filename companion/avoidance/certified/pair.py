"""Agreements of one vehicle with one peer: which it keeps to, and when it may drop one.

An agreement names one plan of each of the two vehicles; both compute the same planes from it. Agreements of a
pair have an order that both know. Each vehicle keeps a list of agreements that its plans satisfy, and states
it with each message. Four rules hold the lists together.

1. *Take.* A vehicle adds only an agreement that is newer than all it has considered, and that its newest plan
   satisfies.
2. *Succession.* It drops an agreement only if its list holds a newer one that the peer has stated.
3. *Withdrawal.* Or if the peer has stated that it has considered this agreement, or a newer one, and the
   peer's list lacks it: by rule 1 the peer never takes it any more.
4. *Void.* An agreement on a plan older than ``since`` is void: its owner has begun anew, elsewhere or after a
   farewell, and makes no plan before a newer agreement is in both lists.

So there is always an agreement in both lists, whatever messages are lost, late, repeated or out of order
(docs/certified.md has the proof). No rule needs a time. What was never sent can be undone (``undo``).
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from mavlink_bridge.wire.agreements import MOST_AGREEMENTS, Entry


class Agreement(NamedTuple):
    """Agreement as one of the two vehicles sees it: epochs (µs) of its ``own`` plan and of the ``other``."""

    own: int
    other: int

    @property
    def epoch(self) -> int:
        """Epoch (µs) from which on its planes are defined."""
        return max(self)


NONE = Agreement(0, 0)
"""Older than every agreement."""


class Pair:
    """Agreements of the vehicle ``own`` with the vehicle ``peer`` (system ids).

    ``leads``: whether this vehicle has the lower id. ``kept``: the own list, from the oldest to the newest.
    ``considered``: the newest agreement that was taken or refused. ``parts``: either may discard all
    agreements without the other, because it is beyond the range.
    """

    def __init__(self, own: int, peer: int, *, parts: bool = False) -> None:
        self._parts = parts
        self._last_list: tuple[Agreement, frozenset[Agreement]] = NONE, frozenset()
        self.leads = own < peer
        self.peer = peer
        self.kept: tuple[Agreement, ...] = ()
        self.considered = NONE
        self._stated: set[Agreement] = set()
        self._others_since = self._last_epoch = 0

    def newer(self, one: Agreement, than: Agreement) -> bool:
        """Return whether ``one`` comes after ``than`` in the order of the pair.

        The order is by the sum of the epochs; then by the epoch of the vehicle with the lower system id.
        """
        return self._rank(one) > self._rank(than)

    def _rank(self, one: Agreement) -> tuple[int, int]:
        return one.own + one.other, one.own if self.leads else one.other

    @property
    def confirmed(self) -> Agreement | None:
        """The newest agreement of the own list that the peer has stated; None without one.

        By rule 2 it is the oldest of the list.
        """
        kept = self.kept
        return kept[0] if kept and kept[0] in self._stated else None

    @property
    def open(self) -> tuple[Agreement, ...]:
        """Agreements of the own list, newer than the confirmed one, that the peer has not stated."""
        return self.kept if self.confirmed is None else self.kept[1:]

    @property
    def offers(self) -> list[Agreement]:
        """Agreements that the peer has stated and that this vehicle may still take, the newest first."""
        found = [one for one in self._stated if self.newer(one, self.considered)]
        return sorted(found, key=self._rank, reverse=True)

    def may_take(self, one: Agreement) -> bool:
        """Return whether rule 1, the void and the room on the wire allow to take ``one``."""
        valid = one.other >= self._others_since
        return valid and self.newer(one, self.considered) and len(self.kept) < MOST_AGREEMENTS

    def take(self, one: Agreement) -> None:
        """Add ``one``, which ``may_take`` allows and the newest plan satisfies, to the list."""
        self.kept = (*self.kept, one)
        self.considered = one
        self._succeed()

    def refuse(self, one: Agreement) -> None:
        """Take neither ``one`` nor an older agreement any more."""
        if self.newer(one, self.considered):
            self.considered = one

    def undo(self, kept: tuple[Agreement, ...], considered: Agreement) -> None:
        """Return to the list ``kept`` and what was ``considered`` then: nothing was stated since."""
        self.kept, self.considered = kept, considered

    def acknowledge(self, other: int) -> bool:
        """Count the peer's plan of ``other`` (µs) as considered, if none since its beginning was.

        It refuses an agreement on this plan and on none of the own, so that every real one remains possible.
        Returns whether it did.
        """
        if not self.considered.other < self._others_since <= other:
            return False
        self.considered = Agreement(self.considered.own, other)
        return True

    def receive(self, epoch: int, since: int, entry: Entry) -> bool:
        """Receive the peer's ``entry`` about this vehicle; return whether the own list has changed.

        ``epoch`` and ``since`` (µs) are those of the statement. A statement of before the peer's last
        beginning is ignored.
        """
        if since < self._others_since:
            return False
        before = self.kept
        if since > self._others_since:
            self._others_since = since
            self._last_list = NONE, frozenset()
            self._stated = {one for one in self._stated if one.other >= since}
            self.kept = tuple(one for one in self.kept if one.other >= since)
        stated = {Agreement(own, other) for other, own in entry.agreements if other >= since}
        considered = Agreement(entry.considered[1], entry.considered[0])
        if self._parts:
            stated = self._still_held(considered, stated)
        self._stated |= stated
        # A statement of before the peer's plan of an agreement cannot have considered that agreement.
        self.kept = tuple(
            one for one in self.kept if one in stated or one.other > epoch or self.newer(one, considered)
        )
        if epoch >= self._last_epoch:
            # Offers that a later statement lacks are gone.
            self._last_epoch = epoch
            kept = set(self.kept)
            self._stated = {one for one in self._stated if one in stated or one in kept}
        self._succeed()
        return self.kept != before

    def _still_held(self, considered: Agreement, stated: set[Agreement]) -> set[Agreement]:
        """Return those of a ``stated`` list that no statement shows to be dropped, and note the list.

        What a peer has considered and does not hold, it never holds again; a late statement does not change
        that. Without parting this follows from the order of agreements alone.
        """
        newest, held = self._last_list
        if self.newer(considered, newest):
            self._last_list = considered, frozenset(stated)
        elif considered == newest:
            self._last_list = newest, held & stated
        newest, held = self._last_list
        found = {one for one in stated if one in held or self.newer(one, newest)}
        gone = {one for one in self._stated if one not in held and not self.newer(one, newest)}
        self._stated -= gone - set(self.kept)
        return found

    def void(self, others_since: int = 0) -> None:
        """Discard all agreements: the own plan has begun anew, or the peer has said farewell.

        Statements of the peer from before ``others_since`` (µs) are ignored from now on.
        """
        self.kept = ()
        self._stated.clear()
        if others_since > self._others_since:
            self._last_list = NONE, frozenset()
        self._others_since = max(self._others_since, others_since)

    def entry(self, *, departed: bool) -> Entry:
        """Return the entry to send to the peer."""
        return Entry(self.peer, self.kept, self.considered, departed)

    def referenced(self) -> Iterable[Agreement]:
        """Return the agreements whose plans are still needed."""
        return {*self.kept, *self.offers}

    def _succeed(self) -> None:
        """Apply rule 2."""
        stated = [index for index, one in enumerate(self.kept) if one in self._stated]
        if stated:
            self.kept = self.kept[stated[-1] :]
