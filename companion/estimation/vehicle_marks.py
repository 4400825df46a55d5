"""Marks of the vehicles that send detections, as parts of the fusion filter.

Those of a vehicle are the mean d² of its detections (0 before the first), the seconds since the last one, and
the place (3) and the velocity (3) of its camera then, m, m/s. A vehicle states where it was a little earlier;
the velocity says how far it has moved on since. The mean d² says whether its detections are too often wrong.
"""

from __future__ import annotations

from math import exp

from companion.values.compiled import part
from companion.values.horizon import Array

_SMOOTH_S, _LONGEST_S = 0.5, 1.0
"""Time constant with which a camera's velocity follows differences of its places; longest of these (s)."""
MEMORY = 0.1
"""Weight of a detection in the mean d² of its vehicle."""
SUSPECT = 2.0
"""Detections of a vehicle are refused while its mean d² is so many times that of others and of true ones."""
DEGREES_OF_FREEDOM = 3.0


@part
def follow_camera(mark: Array, camera: Array, age: float, moved: Array) -> float:
    """Follow the place of the ``camera`` (3,), m, of a new detection; return its share in ``moved``.

    ``mark`` (MARKS,): of the vehicle. ``moved`` (3,), m: how far it has moved on in ``age`` (s) is written.
    The share is that of an error of the new place.
    """
    since: float = mark[1]
    mark[1] = 0.0
    follow = 1.0 - exp(-since / _SMOOTH_S) if since > 0.0 and mark[0] > 0.0 else 0.0
    for a in range(3):
        at, speed = 2 + a, 5 + a
        if since > _LONGEST_S:
            mark[speed] = 0.0
        elif follow > 0.0:
            mark[speed] += follow * ((camera[a] - mark[at]) / since - mark[speed])
        mark[at] = camera[a]
        moved[a] = age * mark[speed]
    return age * follow / max(since, 1e-6)


@part
def trusted(marks: Array, vehicle: int, d2: float, gate: float) -> bool:
    """Count the d² of a detection, ``gate`` at most; return whether its vehicle is not suspect.

    ``marks`` (vehicles, MARKS).
    """
    others, number = 0.0, 0
    for k in range(len(marks)):
        mean = marks[k, 0]
        if k != vehicle and mean > 0.0:
            others += mean
            number += 1
    before = marks[vehicle, 0] if marks[vehicle, 0] > 0.0 else DEGREES_OF_FREEDOM
    marks[vehicle, 0] = before + MEMORY * (min(d2, gate) - before)
    right: bool = number == 0 or marks[vehicle, 0] <= SUSPECT * max(DEGREES_OF_FREEDOM, others / number)
    return right
