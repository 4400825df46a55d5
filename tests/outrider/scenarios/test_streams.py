"""No two things of a seed draw the same numbers."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from outrider.scenarios.streams import Stream, stream


@given(st.integers(0, 2**63))
def test_no_two_streams_of_a_seed_coincide(seed: int) -> None:
    drawn = {(of, number): stream(seed, of, number).random(4) for of in Stream for number in (0, 1, 7)}
    # Starts and phases are drawn once for the whole fleet; only of clocks there are several.
    used = [key for key in drawn if key[0] is Stream.CLOCKS or key[1] == 0]
    assert not any(np.array_equal(drawn[one], drawn[other]) for one, other in combinations(used, 2))


def test_starts_have_the_stream_of_the_bare_seed() -> None:
    assert np.array_equal(stream(5, Stream.STARTS).random(8), np.random.default_rng(5).random(8))
