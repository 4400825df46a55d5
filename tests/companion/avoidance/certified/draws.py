"""Swarms on bad days, for Hypothesis: two to five vehicles that have hardly room to pass each other, and ever
new goals."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from hypothesis import strategies as st

from companion.values.horizon import Array
from tests.companion.avoidance.certified.rough import NEVER, Habits, Rough
from tests.companion.avoidance.certified.swarm import Swarm

UNTIL = 5_000_000
"""µs of a run."""
_NEW_GOAL = 1_500_000
moments = st.integers(0, UNTIL)
lengths = st.sampled_from([20_000, 150_000, 450_000, 2_000_000])
spans = st.builds(lambda begin, length: (begin, begin + length), moments, lengths)
losses = st.sampled_from([0.0, 0.05, 0.3, 0.6, 0.95])
delays = st.sampled_from([0, 30_000, 150_000, 500_000])
"""µs; the last is longer than any epoch here."""


def roughs(systems: int) -> st.SearchStrategy[Rough]:
    some = st.frozensets(st.integers(1, systems), min_size=1, max_size=systems - 1)
    cuts = st.lists(st.builds(lambda span, whom: (*span, whom), spans, some), max_size=2)
    return st.builds(Rough, losses, delays, st.sampled_from([0.0, 0.2]), cuts.map(tuple))


def habits(*, leave: bool) -> st.SearchStrategy[Habits]:
    on = st.integers(0, 400_000)
    return st.builds(
        lambda on, later, leaves, frozen, released, ahead, wanders, away, stalls: Habits(
            on,
            on + later,
            leaves,
            tuple(frozen),
            tuple(released),
            ahead,
            wanders,
            leaves + away,
            stalls=tuple(stalls),
        ),
        on,
        on,
        st.just(NEVER) | st.integers(1_000_000, UNTIL) if leave else st.just(NEVER),
        st.lists(spans, max_size=2),
        st.lists(spans, max_size=1),
        st.integers(-5_000, 5_000),
        st.sampled_from([0.0, 0.08]),
        st.sampled_from([NEVER, 40_000, 300_000, 1_200_000]) if leave else st.just(NEVER),
        st.lists(spans, max_size=2),
    )


@st.composite
def swarms(draw: st.DrawFn, *, leave: bool = False) -> Swarm:
    """One that has flown."""
    k, seed = draw(st.integers(2, 5)), draw(st.integers(0, 2**16))
    rough = draw(roughs(k))
    own = draw(st.lists(habits(leave=leave), min_size=k, max_size=k))
    epoch, shift = draw(st.sampled_from([200_000, 400_000])), draw(st.sampled_from([0.75, 0.0]))
    swarm = Swarm(starts(k, seed), rough, own, seed, epoch=epoch, settings={"plane_shift": shift})
    swarm.run(UNTIL, goals(seed))
    return swarm


def starts(count: int, seed: int) -> Array:
    """Corners (count, 3) of a cube, m, about as near to each other as plans may be."""
    rng = np.random.default_rng(seed)
    corners = np.stack(np.meshgrid([0.0, 1.3], [0.0, 1.3], [4.2, 5.5]), axis=-1).reshape(8, 3)
    chosen: Array = corners[rng.permutation(8)[:count]] + rng.uniform(-0.05, 0.05, (count, 3))
    return chosen


def goals(seed: int) -> Callable[[int, int], Array]:
    """A new one now and then, somewhere in a room that is too small."""

    def goal(since: int, system: int) -> Array:
        rng = np.random.default_rng([seed, since // _NEW_GOAL, system])
        place: Array = rng.uniform([-1.5, -1.5, 3.5], [3.0, 3.0, 7.0])
        return place

    return goal
