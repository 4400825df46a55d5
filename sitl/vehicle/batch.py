"""Rows of vehicles of one type, advanced by the compiled pipeline in blocks or one after the other."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from sitl.vehicle.airframe import FloatArray
from sitl.vehicle.compiled import FLIGHT_SOURCES, entry, kernel, sources_digest
from sitl.vehicle.pipeline import COMMAND_SIZE, advance
from sitl.vehicle.simd import LANES

_MIN_BLOCK_VEHICLES = 3
"""Number of vehicles from which on a block is faster than single rows; its other lanes hold copies."""


@kernel
def fill_block(rows: FloatArray, first: int, block: FloatArray) -> None:
    """Copy rows side by side into a block, from ``first`` on; the last row fills the remaining lanes."""
    for lane in range(LANES):
        row = min(first + lane, rows.shape[0] - 1)
        for column in range(rows.shape[1]):
            block[column, lane] = rows[row, column]


@kernel
def read_block(rows: FloatArray, first: int, block: FloatArray) -> None:
    """Copy the rows from ``first`` on back out of a block."""
    for lane in range(min(LANES, rows.shape[0] - first)):
        for column in range(rows.shape[1]):
            rows[first + lane, column] = block[column, lane]


@kernel
def first_not_finite(rows: FloatArray) -> int:
    """Return the index of the first row whose sum is not finite, or −1."""
    for k in range(rows.shape[0]):
        if not np.isfinite(np.sum(rows[k])):
            return k
    return -1


_Rows = Callable[[FloatArray, FloatArray, NDArray[np.void], int, FloatArray, int], int]


def _build(digest: int) -> tuple[_Rows, _Rows]:
    # The digest is in the closures, and so in the keys of numba's cache.
    @entry
    def singly(
        states: FloatArray,
        commands: FloatArray,
        airframes: NDArray[np.void],
        steps: int,
        tracks: FloatArray,
        start: int,
    ) -> int:
        _ = digest
        bad = first_not_finite(commands)
        if bad >= 0:
            return bad
        airframe = airframes[0]
        speeds = np.empty(airframe.rotor_x.size)
        for k in range(start, states.shape[0]):
            advance(states[k], commands[k], airframe, steps, speeds, tracks[k])
        return -1

    @entry
    def in_blocks(
        states: FloatArray,
        commands: FloatArray,
        airframes: NDArray[np.void],
        steps: int,
        tracks: FloatArray,
        end: int,
    ) -> int:
        _ = digest
        bad = first_not_finite(commands)
        if bad >= 0:
            return bad
        airframe = airframes[0]
        state, command = np.empty((states.shape[1], LANES)), np.empty((COMMAND_SIZE, LANES))
        speeds, track = np.empty((airframe.rotor_x.size, LANES)), np.empty((3 * steps, LANES))
        for first in range(0, end, LANES):
            fill_block(states, first, state)
            fill_block(commands, first, command)
            advance(state, command, airframe, steps, speeds, track)
            read_block(states, first, state)
            read_block(tracks, first, track)
        return -1

    return singly, in_blocks


_singly, _in_blocks = _build(sources_digest(*FLIGHT_SOURCES, "ground.py", "batch.py"))


def advance_rows(
    states: FloatArray, commands: FloatArray, airframes: NDArray[np.void], steps: int, tracks: FloatArray
) -> int:
    """Advance states (K, STATE_SIZE + 2 n) under commands (K, COMMAND_SIZE) by ``steps`` steps.

    ``airframes`` (1,) is the record, ``tracks`` (K, 3 steps) receives the positions after each step. The
    function changes states and tracks in place and returns −1; or it returns the index of a command row that
    is not finite, and changes nothing. The other arrays are C-contiguous float64. The motion of a vehicle
    depends neither on the others nor on whether it is in a block, so the faster way is chosen.
    """
    count = len(states)
    rest = count % LANES
    blocks = count if rest >= _MIN_BLOCK_VEHICLES else count - rest
    if blocks:
        bad = _in_blocks(states, commands, airframes, steps, tracks, blocks)
        if bad >= 0 or blocks == count:
            return bad
    return _singly(states, commands, airframes, steps, tracks, blocks)
