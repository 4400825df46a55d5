"""Alignment of plans with measured positions: which plan counts, and where its sender is otherwise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from companion.obstacles.relevance_filter import Ages
from companion.values.compiled import BOOL, FLOAT, INT, VOID, array, kernel, output
from companion.values.horizon import Array


def within(planned: Array, places: Array, strayed: float | Array) -> NDArray[np.bool_]:
    """Return which (M,) of the ``planned`` places (M, 3) are within ``strayed`` (m) of ``places`` (M, 3)."""
    off = planned - places
    return np.asarray(np.vecdot(off, off) <= strayed**2)


@kernel(VOID, array(2), array(1, INT), INT, output(2))
def extrapolate(states: Array, ages: Ages, most: int, here: Array) -> None:
    """Write to ``here`` (M, 3) the present positions by the last ``states`` (M, 6), ``ages`` (M,) µs old.

    They move at constant velocity for ``most`` µs and then rest.
    """
    for j in range(len(states)):
        carried = 1e-6 * min(max(ages[j], 0), most)
        for i in range(3):
            here[j, i] = states[j, i] + carried * states[j, 3 + i]


@kernel(
    VOID,
    array(2),
    array(1, INT),
    array(2),
    array(1, BOOL),
    FLOAT,
    array(1),
    FLOAT,
    INT,
    output(3),
    output(1, BOOL),
)
def align(
    states: Array,
    ages: Ages,
    here: Array,
    silent: NDArray[np.bool_],
    deviation: float,
    fading: Array,
    step: float,
    most: int,
    positions: Array,
    trusted: NDArray[np.bool_],
) -> None:
    """Replace planned ``positions`` (M, N + 1, 3) of neighbours by measured ones where plans do not count.

    A plan is no longer ``trusted`` (M,) if it is further than ``deviation`` (m) from the measured place
    ``here`` (M, 3). A vehicle beside a trusted plan returns to it by the shares ``fading`` (N + 1,); if these
    are empty, or the vehicle is ``silent`` (M,), its plan is used as it is. Without a trusted plan a
    neighbour rests; if its state is at most ``most`` (µs) old, it moves on at constant velocity, with
    ``step`` (s) between positions.
    """
    off = np.empty(3)
    for j in range(len(positions)):
        square = 0.0
        for i in range(3):
            off[i] = here[j, i] - positions[j, 0, i]
            square += off[i] * off[i]
        trusted[j] = trusted[j] and square <= deviation * deviation
        moves = ages[j] <= most
        for n in range(positions.shape[1]):
            for i in range(3):
                if not trusted[j]:
                    positions[j, n, i] = here[j, i]
                    if moves:
                        positions[j, n, i] += n * step * states[j, 3 + i]
                elif not silent[j] and len(fading):
                    positions[j, n, i] += fading[n] * off[i]
