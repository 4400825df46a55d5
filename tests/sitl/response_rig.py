"""Responses of the firmwares' position controllers, and paths of set-points for them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sitl.autopilot.position_control.airframe import Motion
from sitl.autopilot.response import Response, response_of
from sitl.config.autopilot import AutopilotConfig
from tests.sitl.autopilot_rig import ZERO

DT = 0.01
Array = NDArray[np.float64]
Path = Callable[[float], Motion]


HOVER = (0.0, 0.0, -5.0)


def config(flavour: str, **more: Any) -> AutopilotConfig:
    return AutopilotConfig(
        **{
            "system_id": 1,
            "flavour": flavour,
            "latitude": 0.0,
            "longitude": 0.0,
            "response": "firmware",
            **more,
        }
    )


def made(flavour: str, **more: Any) -> Response:
    response = response_of(config(flavour, **more))
    assert response is not None
    return response


def motion(position: ArrayLike, velocity: ArrayLike = ZERO, acceleration: ArrayLike = ZERO) -> Motion:
    north, east, down = np.transpose((position, velocity, acceleration)).tolist()
    return tuple(zip(north, east, down, strict=True))  # type: ignore[return-value]


def circle(t: float, radius: float = 5.0, speed: float = 3.0) -> Motion:
    """Its jerk is 1.1 m/s³."""
    w = speed / radius
    c, s = math.cos(w * t), math.sin(w * t)
    return motion(
        (radius * c, radius * s, -3.0),
        (-speed * s, speed * c, 0.0),
        (-w * speed * c, -w * speed * s, 0.0),
    )


def reversing(t: float, speed: float = 3.0, push: float = 3.0) -> Motion:
    """North at ``speed`` for 10 s, then back as fast, with a jump of acceleration."""
    late = max(t - 10.0, 0.0)
    turn = min(late, 2.0 * speed / push)
    velocity = speed - push * turn
    way = speed * (t - late) + speed * turn - 0.5 * push * turn * turn + velocity * (late - turn)
    acceleration = -push if 0.0 < late < 2.0 * speed / push else 0.0
    return motion((way, 0.0, -5.0), (velocity, 0.0, 0.0), (acceleration, 0.0, 0.0))


def led(
    response: Response, path: Path, seconds: float, *, dt: float = DT, wind: Sequence[float] = ZERO
) -> tuple[Array, Array]:
    """Motion and desired motion (n, 3, 3) along a path, from its beginning and at its speed."""
    begin, velocity, _ = path(0.0)
    response.restart(begin)
    response.relocate(begin, velocity)
    flown, desired = [], []
    for k in range(round(seconds / dt)):
        response.advance(path((k + 1) * dt), dt, tuple(wind))  # type: ignore[arg-type]
        flown.append(response.motion)
        desired.append(response.desired)
    return np.array(flown), np.array(desired)


def wanted(path: Path, seconds: float, dt: float = DT) -> Array:
    return np.array([path((k + 1) * dt) for k in range(round(seconds / dt))])


def step(metres: float) -> Path:
    """Set-points that jump north at once, away from where the vehicle begins."""
    return lambda t: motion((metres if t > 0.0 else 0.0, 0.0, -5.0))
