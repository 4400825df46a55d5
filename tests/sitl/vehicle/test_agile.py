"""The agile quadrotor follows 20 m/s² with a jerk of 30 m/s³; the firefly cannot."""

from __future__ import annotations

import numpy as np
import pytest

from outrider.resources import find
from outrider.yaml_files.yaml_file import load
from sitl.vehicle.config import VehicleConfig
from sitl.vehicle.multirotor import Reference, Vehicle

_DT, _MOST, _JERK, _HOLD = 0.01, 20.0, 30.0, 0.4


def largest_error(name: str, direction: np.ndarray) -> float:
    """Return the largest tracking error (m) on a way there and to rest again with 20 m/s²."""
    config = load(find("vehicles", name), VehicleConfig)
    vehicle = Vehicle(config, (0.0, 0.0, -50.0), hovering=True)
    position, velocity, acceleration = np.array((0.0, 0.0, -50.0)), np.zeros(3), np.zeros(3)
    rise = _MOST / _JERK
    worst = 0.0
    for jerk, seconds in ((1, rise), (0, _HOLD), (-1, 2 * rise), (0, _HOLD), (1, rise), (0, 1.0)):
        j = jerk * _JERK * direction
        for _ in range(round(seconds / _DT)):
            vehicle.advance(4, Reference(position, velocity, acceleration, j))
            position = position + _DT * (velocity + _DT * (acceleration / 2.0 + _DT / 6.0 * j))
            velocity, acceleration = velocity + _DT * (acceleration + _DT / 2.0 * j), acceleration + _DT * j
            worst = max(worst, float(np.linalg.norm(vehicle.state.position - position)))
    return worst


@pytest.mark.parametrize("direction", [(1.0, 0.0, 0.0), (0.6, -0.8, 0.0)])
def test_the_agile_quadrotor_follows_20_m_s2_within_5_cm(direction: tuple[float, float, float]) -> None:
    assert largest_error("agile", np.array(direction)) < 0.05


def test_the_firefly_does_not() -> None:
    assert largest_error("firefly", np.array((1.0, 0.0, 0.0))) > 1.0
