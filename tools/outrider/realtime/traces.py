"""True motion of one vehicle: recorded by the process that simulates it, merged by the parent."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from mavlink_bridge.frames import ned_to_enu
from outrider.runs.ground_truth import ROW, SAMPLE, Array, GroundTruth
from outrider.simulation.moving import MovingObstacle
from outrider.simulation.moving import places as moving_places
from outrider.simulation.targets import Placed, Target
from outrider.simulation.truth_observer import places, rows
from sitl.node import Autopilot


class Trace(NamedTuple):
    """Trace of one vehicle.

    ``times`` (n,) of all physics steps (µs); ``positions`` (n, 3) ENU (m), NaN on the ground; ``sampled``
    (m,) times of the samples (µs); ``rows`` (m, ROW), see ``ground_truth.ROW``.
    """

    times: NDArray[np.int64]
    positions: Array
    sampled: NDArray[np.int64]
    rows: Array

    @classmethod
    def load(cls, path: Path) -> Self:
        """Load a file that ``TraceWriter.save`` wrote."""
        with np.load(path) as file:
            return cls(*(file[name] for name in cls._fields))


class TraceWriter:
    """Recorder of the trace of ``autopilot``, step by step."""

    def __init__(self, autopilot: Autopilot) -> None:
        self._autopilot = autopilot
        self._times: list[NDArray[np.int64]] = [np.empty(0, dtype=np.int64)]
        self._positions: list[Array] = [np.empty((0, 3))]
        self._sampled: list[int] = []
        self._rows: list[Array] = []

    def see(self, now: int) -> Array | None:
        """Record the trace after a step at ``now`` (µs); return the sample (ROW,), or None if none is due."""
        autopilot = self._autopilot
        track = ned_to_enu(autopilot.trace)
        if not autopilot.airborne:
            track[:] = np.nan
        self._times.append(autopilot.trace_times)
        self._positions.append(track)
        if self._sampled and now // SAMPLE == self._sampled[-1] // SAMPLE:
            return None
        sample: Array = rows([autopilot])[0]
        self._sampled.append(now)
        self._rows.append(sample)
        return sample

    def save(self, path: Path) -> None:
        """Write the trace as NumPy arrays."""
        trace = Trace(
            np.concatenate(self._times),
            np.concatenate(self._positions),
            np.array(self._sampled, dtype=np.int64),
            np.array(self._rows).reshape(-1, ROW),
        )
        with path.open("wb") as file:
            np.savez(file, **trace._asdict())


class Moved:
    """Target that repeats the ``moves`` made by hand: (time (µs), place (3,)), in the order of time."""

    def __init__(self, target: Target, moves: Sequence[tuple[int, Array]]) -> None:
        self._target, self._moves = target, deque(moves)

    def begin(self, now: int) -> None:
        """Start the target at the goal event."""
        self._target.begin(now)

    def position(self, now: int) -> Array | None:
        """Return the target's position at ``now``; the times of the calls must not decrease."""
        while self._moves and self._moves[0][0] <= now:
            self._target.move(*self._moves.popleft())
        return self._target.position(now)


def put_together(
    traces: list[Trace],
    period: int,
    target: Placed,
    moving: Sequence[MovingObstacle],
    goal: int | None,
    truth: GroundTruth,
) -> None:
    """Pass the flight of all vehicles to ``truth`` on one grid of physics steps (``period`` µs).

    The grid covers the time that all traces have in common. ``target`` and ``moving`` are fresh copies; they
    begin at ``goal`` (µs), or not at all if it is None.
    """
    begin = max(int(trace.times[0]) for trace in traces)
    end = min(int(trace.times[-1]) for trace in traces)
    begin += -begin % SAMPLE
    begun = False
    for now in range(begin + SAMPLE, end + 1, SAMPLE):
        if goal is not None and not begun and now >= goal:
            target.begin(goal)
            for one in moving:
                one.begin(goal)
            begun = True
        steps = np.arange(now - SAMPLE + period, now + 1, period)
        track = np.stack([_at(trace, steps) for trace in traces], axis=1)
        sampled = np.array([_sample(trace, now) for trace in traces])
        times = steps.tolist()
        truth.take(now, track, sampled, places(target, times), moving_places(moving, times))


def _at(trace: Trace, steps: NDArray[np.int64]) -> Array:
    """Return the positions (n, 3) at ``steps``, interpolated where they are not on the trace's grid."""
    after = np.clip(np.searchsorted(trace.times, steps), 1, len(trace.times) - 1)
    left, right = trace.times[after - 1], trace.times[after]
    share = ((steps - left) / (right - left))[:, None]
    between: Array = (1.0 - share) * trace.positions[after - 1] + share * trace.positions[after]
    exact = right == steps
    between[exact] = trace.positions[after[exact]]
    return between


def _sample(trace: Trace, now: int) -> Array:
    """Return the last sample up to ``now``."""
    index = max(int(np.searchsorted(trace.sampled, now, side="right")) - 1, 0)
    result: Array = trace.rows[index]
    return result
