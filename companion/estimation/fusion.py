"""Fusion of detections: inserted at the times of their images, gated, and extrapolated.

Detections are kept in the order of their images, each with the filter's state after it. New ones are
processed together when a state is needed: from the earliest on, all later ones are processed again. So the
result does not depend on the order of arrival. A place that contradicts the state is refused; if nothing
passes for a while and the refused ones agree with each other, the filter begins anew with them.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from math import log, radians
from typing import NamedTuple

import numpy as np

from companion.config.target_source import FusedSource, OwnErrors
from companion.estimation.acceleration_adaptation import AGREE_M, AGREE_M_S
from companion.estimation.detections import Detection
from companion.estimation.fusion_filter import (
    ADAPTED,
    FIELDS,
    GROUPS,
    MARKS,
    PER_VEHICLE,
    SENSITIVITY,
    TARGET,
    ahead,
    replay,
)
from companion.values.horizon import Array

_FIRST_SIGMA_M, _FIRST_SIGMA_M_S = 100.0, 2.0
"""σ of place and velocity before the first detection."""
_CAPACITY = 512
"""Largest number of detections that are kept."""
_WINDOW_SHARE = 2
"""Detections of at least the window, and of this many windows at most, are kept."""
_REMEMBERED = 16
"""Number of detections of each vehicle that passed and are remembered for longer than the window."""
_RESTART_US, _WITNESSES = 1_000_000, 3
"""After this time without a passing detection so many refused ones restart the filter that agree."""


class Belief(NamedTuple):
    """What is known of the target: ``position`` (3,) m, ``velocity`` (3,) m/s, fleet-local ENU.

    ``covariance`` (3, 3): of the position; ``time`` (µs): of the image of the last detection that passed;
    ``turn_rate`` (rad/s): rate of change of the course, counter-clockwise seen from above.
    """

    time: int
    position: Array
    velocity: Array
    covariance: Array
    turn_rate: float = 0.0


class Seen(NamedTuple):
    """Number of a vehicle's detections, and the median of their w_k (1/m²).

    w_k is computed with the measured distance: in a mean a false detection nearby that passed would weigh
    as much as ten others.
    """

    number: int
    weight: float


class Fusion:
    """Filter of all detections; times are the companion's own, in µs.

    ``window``: µs by which a detection may be late. ``late``: number of detections that were later.
    """

    def __init__(self, config: FusedSource, window: int) -> None:
        self._window = window
        self._noise = _noise(config)
        self._time_sigma = 1e-6 * config.errors.sigma_time_us
        self._accelerations = np.square([config.sigma_acceleration, config.sigma_climb])
        self._variances = self._noise[-2 * PER_VEHICLE :: 2]
        self._slots: dict[int, int] = {}
        self._detections: list[Detection] = []
        self._pending: list[Detection] = []
        self._times = np.zeros(_CAPACITY, dtype=np.int64)
        self._rows = np.zeros(_CAPACITY, dtype=np.int64)
        self._data = np.zeros((_CAPACITY, FIELDS))
        self._used = np.zeros(_CAPACITY, dtype=bool)
        self._nis = np.zeros(_CAPACITY)
        self._vehicles = np.zeros(_CAPACITY, dtype=np.int64)
        self._weights = np.zeros(_CAPACITY)
        self._newest = 0
        self._earlier: dict[int, deque[tuple[int, float]]] = {}
        self._began: int | None = None
        self._passed: int | None = None
        self._x0, self._P0, self._memory0 = np.zeros(TARGET), np.zeros((TARGET, TARGET)), np.zeros(ADAPTED)
        self._allocate()
        self.late = self.restarts = 0
        self._forgotten_used = self._forgotten_refused = 0

    def put(self, detection: Detection) -> bool:
        """Add a detection; return False if it is older than the window."""
        if self._began is None:
            self._began = self._newest = detection.time
            self._start(detection)
        elif detection.time < self._newest - self._window:
            self.late += 1
            return False
        elif not self._detections and not self._pending:
            self._began = min(self._began, detection.time)
        self._newest = max(self._newest, detection.time)
        self._pending.append(detection)
        if len(self._pending) == _CAPACITY // 2:
            self._process()
        return True

    @property
    def used(self) -> int:
        """Number of detections that passed the gate, of those processed so far."""
        self._process()
        return self._forgotten_used + int(np.count_nonzero(self._used[: len(self._detections)]))

    @property
    def refused(self) -> int:
        """Number of detections that the gate refused."""
        self._process()
        count = len(self._detections)
        return self._forgotten_refused + count - int(np.count_nonzero(self._used[:count]))

    @property
    def time(self) -> int | None:
        """Time (µs) of the image of the last detection that passed; None before the first."""
        self._process()
        return self._passed

    def at(self, time: int, longest: int) -> Belief | None:
        """Return what is known at ``time`` (µs); None before the first detection.

        It moves on from the last detection for ``longest`` µs and then rests; the covariance grows on.
        """
        self._process()
        count, passed = len(self._detections), self.time
        if not count or passed is None:
            return None
        x, P, memory = self._states[count - 1], self._covariances[count - 1], self._memories[count - 1]
        # Before the last detection, the state is that at it.
        elapsed = max(time - int(self._times[count - 1]), 0)
        state, covariance = np.empty(TARGET), np.empty((3, 3))
        ahead(1e-6 * elapsed, 1e-6 * min(elapsed, longest), x, P, memory, self._noise, state, covariance)
        # An error of the images' times moves the place along the velocity.
        along = self._time_sigma * x[3:6]
        covariance += np.outer(along, along)
        # (v × a)/v², smaller where the velocity is mostly noise.
        vx, vy, _, ax, ay, _ = state[3:].tolist()
        rate = (vx * ay - vy * ax) / (vx * vx + vy * vy + float(P[3, 3] + P[4, 4]))
        return Belief(passed, state[:3], state[3:6], covariance, rate)

    def recent(self, since: int) -> dict[int, Seen]:
        """Return the detections of images from ``since`` (µs) on that passed, by vehicle.

        Of those older than the window, at least the last ``_REMEMBERED`` of each vehicle count.
        """
        self._process()
        count = len(self._detections)
        rows = slice(int(self._times[:count].searchsorted(since)), count)
        used = self._used[rows]
        vehicles, weights = self._vehicles[rows][used], self._weights[rows][used]
        if count and since < int(self._times[0]):
            older = [
                (system, weight)
                for system, earlier in self._earlier.items()
                for time, weight in earlier
                if time >= since
            ]
            if older:
                vehicles = np.concatenate([[system for system, _ in older], vehicles])
                weights = np.concatenate([[weight for _, weight in older], weights])
        ordered = weights[np.lexsort((weights, vehicles))].tolist()
        found, first = {}, 0
        for system, number in enumerate(np.bincount(vehicles).tolist()):
            if number:
                low, high = first + (number - 1) // 2, first + number // 2
                found[system] = Seen(number, 0.5 * (ordered[low] + ordered[high]))
                first += number
        return found

    @property
    def innovations(self) -> Array:
        """d² (N,) of the detections in the window that passed."""
        self._process()
        count = len(self._detections)
        return self._nis[:count][self._used[:count]].copy()

    def _start(self, first: Detection) -> None:
        """Begin with nothing known but that the target is about where ``first`` places it."""
        self._x0 = np.zeros(len(self._x0))
        self._x0[:3] = first.fields[:3]
        self._P0 = self._prior()
        self._memory0 = self._fresh_memory()
        self._passed = None

    def _prior(self) -> Array:
        errors = np.tile(self._variances, len(self._slots))
        place, speed = [_FIRST_SIGMA_M**2] * 3, [_FIRST_SIGMA_M_S**2] * 3
        level, upward = self._accelerations
        return np.diag(np.concatenate([place, speed, [level, level, upward], errors]))

    def _fresh_memory(self) -> Array:
        """Return the filter's memory before the first detection: the configured accelerations, no errors."""
        level, upward = self._accelerations
        memory = np.zeros(ADAPTED + MARKS * len(self._slots))
        size = GROUPS * TARGET * TARGET
        sensitivity = memory[SENSITIVITY : SENSITIVITY + size].reshape(GROUPS, TARGET, TARGET)
        sensitivity[0, 6, 6] = sensitivity[0, 7, 7] = level
        sensitivity[1, 8, 8] = upward
        return memory

    def _allocate(self) -> None:
        n = TARGET + PER_VEHICLE * len(self._slots)
        x0, P0, memory0 = self._x0, self._P0, self._memory0
        self._x0, self._P0, self._memory0 = np.zeros(n), self._prior(), self._fresh_memory()
        self._x0[: len(x0)], self._P0[: len(x0), : len(x0)] = x0, P0
        self._memory0[: len(memory0)] = memory0
        self._states, self._covariances = np.zeros((_CAPACITY, n)), np.zeros((_CAPACITY, n, n))
        self._memories = np.zeros((_CAPACITY, len(self._memory0)))

    def _process(self) -> None:
        """Process the pending detections, and all with later images again."""
        if not self._pending or self._began is None:
            return
        pending, self._pending = self._pending, []
        if len(self._detections) + len(pending) > _CAPACITY:
            # Of processed ones alone is the state known with which the filter then begins.
            self._drop(_CAPACITY // 2)
        new = {one.vehicle for one in pending if not one.estimate} - self._slots.keys()
        first = len(self._detections)
        for vehicle in sorted(new):
            self._slots[vehicle] = len(self._slots)
        if new:
            self._allocate()
            first = 0
        for one in sorted(pending, key=_order):
            first = min(first, self._insert(one))
        count = len(self._detections)
        replay(
            self._times, self._rows, self._data, first, count, self._began,
            self._x0, self._P0, self._memory0, self._noise,
            self._states, self._covariances, self._memories, self._used, self._nis,
        )  # fmt: skip
        last = count - 1 - int(self._used[count - 1 :: -1].argmax())
        if self._used[last]:
            self._passed = self._detections[last].time
        if not self._used[last] or self._detections[-1].time - self._detections[last].time > _RESTART_US:
            self._restart_if_wrong()
        self._forget()

    def _insert(self, one: Detection) -> int:
        """Insert a detection in the order of images; return its index."""
        count = len(self._detections)
        place = count
        if count and _order(one) < _order(self._detections[-1]):
            place = bisect_right(self._detections, _order(one), key=_order)
            for column in (self._times, self._rows, self._data, self._vehicles, self._weights):
                column[place + 1 : count + 1] = column[place:count].copy()
        self._detections.insert(place, one)
        self._times[place] = one.time
        self._rows[place] = -1 if one.estimate else self._slots[one.vehicle]
        self._data[place] = one.fields
        self._vehicles[place], self._weights[place] = one.vehicle, one.weight
        return place

    def _forget(self) -> None:
        """Drop what is older than the window once it is twice as much: nothing is inserted there any more."""
        count = len(self._detections)
        if count and self._detections[0].time < self._detections[-1].time - _WINDOW_SHARE * self._window:
            old = int(np.searchsorted(self._times[:count], self._times[count - 1] - self._window))
            self._drop(min(old, count - 1))

    def _drop(self, old: int) -> None:
        """Drop the first ``old`` detections; the filter begins with the state after them."""
        if old <= 0:
            return
        count, used = len(self._detections), int(np.count_nonzero(self._used[:old]))
        self._forgotten_used += used
        self._forgotten_refused += old - used
        for row in np.flatnonzero(self._used[:old]).tolist():
            earlier = self._earlier.setdefault(int(self._vehicles[row]), deque(maxlen=_REMEMBERED))
            earlier.append((int(self._times[row]), float(self._weights[row])))
        self._began = int(self._times[old - 1])
        self._x0, self._P0 = self._states[old - 1].copy(), self._covariances[old - 1].copy()
        self._memory0 = self._memories[old - 1].copy()
        short = self._times, self._rows, self._data, self._vehicles, self._weights, self._used, self._nis
        for column in (*short, self._states, self._covariances, self._memories):
            # In parts that do not overlap: a copy of all covariances would take a millisecond.
            for begin in range(0, count - old, old):
                end = min(begin + old, count - old)
                column[begin:end] = column[begin + old : end + old]
        del self._detections[:old]

    def _restart_if_wrong(self) -> None:
        """Begin anew with detections that agree, where all of the last ``_RESTART_US`` are refused."""
        count, one = len(self._detections), self._detections[-1]
        recent = range(int(np.searchsorted(self._times[:count], one.time - _RESTART_US)), count)
        agreeing = [row for row in recent if self._agree(self._detections[row], one)]
        if len(agreeing) < _WITNESSES:
            return
        self.restarts += 1
        kept = [self._detections[row] for row in agreeing]
        self._drop(count - 1)
        self._forgotten_refused += 1
        self._detections.clear()
        # What passed was near a wrong place.
        self._earlier.clear()
        self._began = kept[0].time
        self._start(kept[0])
        self._forgotten_refused -= len(kept)
        self._pending = kept
        self._process()

    @staticmethod
    def _agree(one: Detection, other: Detection) -> bool:
        apart = float(np.linalg.norm(one.fields[:3] - other.fields[:3]))
        return apart <= AGREE_M + AGREE_M_S * 1e-6 * abs(one.time - other.time)


def _order(one: Detection) -> tuple[int, int]:
    """Return the key by which detections are ordered: the image's time, then the vehicle."""
    return one.time, one.vehicle


def _noise(config: FusedSource) -> Array:
    """Return the vector ``noise`` of ``replay``."""
    errors: OwnErrors = config.errors
    horizontal, vertical = errors.sigma_horizontal**2, errors.sigma_vertical**2
    position, yaw = 1.0 / errors.position_s, radians(errors.sigma_yaw_deg) ** 2
    tilt = radians(errors.sigma_tilt_deg) ** 2
    target = [config.sigma_acceleration**2, config.sigma_climb**2, 1.0 / config.acceleration_s]
    adaptation = [1.0 / config.adapt_s, 2.0 * log(config.adapt)]
    times = [1e-6 * errors.age_us, (1e-6 * errors.sigma_image_us) ** 2]
    parts = [horizontal, position, horizontal, position, vertical, position]
    parts += [yaw, 1.0 / errors.yaw_s, tilt, 1.0 / errors.tilt_s]
    return np.array([config.gate, errors.sigma_white**2, *target, *adaptation, *times, *parts])
