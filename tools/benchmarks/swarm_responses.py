"""Emulated position controllers on the set-points of a recorded swarm: distance from the truth.

recorded vehicle → its own set-points, at their times → firmware's response alone → distance from the truth

Nothing is fitted to a flight. ArduCopter's estimate was within a few centimetres of the truth and is taken as
the truth. PX4's estimate was off by 0.3 m in the median and by 0.8 m at times, and PX4 flies on its estimate;
the emulation therefore gets the recorded error of the estimate, too. A controller that estimates x + e and
receives the set-point g acts like a controller at x that receives g − e.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from benchmarks.recorded_swarms import Array, SwarmVehicle, at_times
from sitl.autopilot.response import response_of
from sitl.config.autopilot import AutopilotConfig
from sitl.values.setpoints import POSITION, Setpoint

STEP: Final = 0.01
"""Step (s) of the response: the period at which the autopilot renews its reference."""
LATENCY: Final = 0.005
"""Delay (s) between sending a set-point and its arrival at the autopilot."""
WINDOW: Final = 10.0
"""Length (s) of the worst section of a flight."""
_STRIDE: Final = 100
"""Number of steps between the starts of two such sections."""


class Followed(NamedTuple):
    """Positions of the emulation, and of the vehicle."""

    times: Array  # (n,) s
    places: Array  # (n, 3) m, NED
    truth: Array  # (n, 3) m, NED

    @property
    def errors(self) -> Array:
        """Distances (n,), m, between both."""
        return np.asarray(np.linalg.norm(self.places - self.truth, axis=1))


class Deviations(NamedTuple):
    """Deviations of the emulation from the truth, m.

    ``worst`` is the 95th percentile of the ten seconds in which it is largest, and ``since`` (s) their start.
    """

    p50: float
    p95: float
    worst: float
    since: float

    @classmethod
    def of(cls, followed: Followed) -> Deviations:
        """Return the deviations of one vehicle's flight."""
        errors = followed.errors
        length = round(WINDOW / STEP)
        begins = range(0, max(1, len(errors) - length), _STRIDE)
        worst = [float(np.percentile(errors[k : k + length], 95.0)) for k in begins]
        at = int(np.argmax(worst))
        p50, p95 = np.percentile(errors, (50.0, 95.0)).tolist()
        return cls(p50, p95, worst[at], float(followed.times[begins[at]]))


def follow(vehicle: SwarmVehicle) -> Followed:
    """Fly a vehicle's set-points with its firmware's response and default parameters.

    The flight starts with the true motion at the first set-point.
    """
    times = np.arange(vehicle.setpoints[0, 0], vehicle.setpoints[-1, 0], STEP)
    true = at_times(vehicle.truth, times)
    carried = vehicle.flavour == "ardupilot"
    off = np.zeros_like(true) if carried else at_times(vehicle.estimate, times) - true
    response = response_of(
        AutopilotConfig(
            system_id=vehicle.system,
            flavour=vehicle.flavour,
            latitude=0.0,
            longitude=0.0,
            response="firmware",
        )
    )
    if response is None:
        raise TypeError("no response for firmware")
    x, y, z, u, v, w = true[0].tolist()
    response.restart((x, y, z))
    response.relocate((x, y, z), (u, v, w))
    waiting = [(row[0] + LATENCY, _setpoint(row)) for row in vehicle.setpoints.tolist()]
    waiting.reverse()
    since, setpoint = waiting.pop()
    places = [(x, y, z)]
    for now, (a, b, c, d, e, f) in zip(times[1:].tolist(), off[1:].tolist(), strict=True):
        while waiting and waiting[-1][0] <= now:
            since, setpoint = waiting.pop()
        wanted = setpoint.after(max(now - since, 0.0) if carried else 0.0, math.inf)
        (x, y, z), (u, v, w) = wanted.position, wanted.velocity
        response.advance(((x - a, y - b, z - c), (u - d, v - e, w - f), wanted.acceleration), STEP)
        places.append(response.motion[0])
    return Followed(times, np.array(places), true[:, :3])


def closest(first: Followed, second: Followed) -> tuple[float, float]:
    """Return the least distance, m, of two vehicles of one flight: emulated, and true."""
    begin, end = max(first.times[0], second.times[0]), min(first.times[-1], second.times[-1])
    times = np.arange(begin, end, STEP)
    emulated, true = (
        float(np.linalg.norm(_between(first, a, times) - _between(second, b, times), axis=1).min())
        for a, b in ((first.places, second.places), (first.truth, second.truth))
    )
    return emulated, true


def _between(followed: Followed, places: Array, times: Array) -> Array:
    return np.column_stack([np.interp(times, followed.times, column) for column in places.T])


def _setpoint(row: list[float]) -> Setpoint:
    x, y, z, u, v, w, a, b, c = row[1:]
    return Setpoint((POSITION, POSITION, POSITION), (x, y, z), (u, v, w), (a, b, c))
