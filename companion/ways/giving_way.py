"""Giving way: one step of all vehicles on a lattice, of which each place holds one.

PIBT (K. Okumura, M. Machida, X. Défago, Y. Tamura, 2019): vehicles choose their next places in the order of
their priorities, each the free one nearest to its goal. Where a vehicle of lower priority stands there, it
chooses next, with the priority of the one that it has to make room for, and not the place that this comes
from; if it finds none, the other one takes its second choice. Nothing but the arguments decides, so that
vehicles that know the same work out the same steps.

Unlike there, vehicles do not turn in a circle in which each takes the place of the next: vehicles enter a
place once it has been left, so all of a circle would wait for each other. Where all others leave before, the
first one goes to a free place.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Lengths = NDArray[np.int64]


def step(
    at: Sequence[int], order: Sequence[int], lengths: Sequence[Lengths], beside: Sequence[Sequence[int]]
) -> list[int]:
    """Return the next places of the vehicles that are ``at`` different places; each stays or goes beside.

    ``order``: the vehicles by descending priority. ``lengths`` (n,) of each vehicle: steps from each place to
    its goal. No two are at one place, and who takes another's place follows one that goes to a free place.
    """
    nexts: dict[int, int] = {}
    taken: dict[int, int] = {}
    holds = {place: one for one, place in enumerate(at)}

    def closes(place: int, here: int) -> bool:
        """Return whether those that stand at ``place``, and at the place that these go to …, end ``here``."""
        other = holds.get(place)
        while other is not None and other in nexts and nexts[other] != place:
            place = nexts[other]
            if place == here:
                return True
            other = holds.get(place)
        return False

    def moves(one: int, pusher: int | None) -> bool:
        here = at[one]
        choices = sorted(
            (*beside[here], here), key=lambda place: (int(lengths[one][place]), place in holds, place)
        )
        for place in choices:
            if place in taken or (pusher is not None and place == at[pusher]):
                continue
            other = holds.get(place)
            if place != here and closes(place, here):
                continue
            nexts[one], taken[place] = place, one
            if other is not None and other != one and other not in nexts and not moves(other, one):
                # It stays where it is.
                taken[place] = other
                del nexts[one]
                continue
            return True
        nexts[one], taken[here] = here, one
        return False

    for one in order:
        if one not in nexts:
            moves(one, None)
    return [nexts[one] for one in range(len(at))]
