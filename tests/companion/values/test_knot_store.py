"""Each plan is stored once in a process, and its row lasts as long as its array."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from companion.values.knot_store import KnotStore


@given(st.lists(st.tuples(st.booleans(), st.integers(1, 20)), max_size=300))
def test_a_row_holds_its_knots_until_the_array_is_gone(acts: list[tuple[bool, int]]) -> None:
    store = KnotStore()
    held: list[tuple[NDArray[np.float64], int]] = []
    for number, (adds, size) in enumerate(acts):
        if adds or not held:
            held.append((knots := np.full((size, 9), float(number)), store.row_of(knots)))
        else:
            held.pop(size % len(held))
        for array, row in held:
            assert store.row_of(array) == row
            assert np.array_equal(store.knots[row, : len(array)], array)
        assert len({row for _, row in held}) == len(held)


def test_rows_are_used_again() -> None:
    store = KnotStore()
    for _ in range(1000):
        store.row_of(np.zeros((17, 9)))
    assert len(store.knots) == len(KnotStore().knots)
