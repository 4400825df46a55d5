"""Plans whose acceleration steps at each knot: the vehicle stays upright and near them."""

from __future__ import annotations

import math

import numpy as np

from tests.sitl.autopilot_rig import ALL, Rig, setpoint

KNOT, TICK = 0.22, 0.01
"""s; set-points come at 50 Hz."""


def test_a_vehicle_follows_accelerations_that_change_sign_at_each_second_knot() -> None:
    """With a jerk from each step in addition to the step itself the tilt reached 55° and the error 1 m."""
    rig = Rig(tick=round(TICK * 1e6)).hover(20.0)
    place = np.array([*rig.position[:2], -20.0])
    position, velocity = np.zeros(3), np.zeros(3)
    error = tilt = 0.0
    for knot in range(30):
        acceleration = (2.0 if (knot + 1) // 2 % 2 else -2.0) * np.ones(3)
        for tick in range(round(KNOT / TICK)):
            message = setpoint(ALL, *map(tuple, (place + position, velocity, acceleration)))
            rig.step(*([message] if tick % 2 == 0 else []))
            position += TICK * velocity + 0.5 * TICK**2 * acceleration
            velocity += TICK * acceleration
            _, x, y, _ = rig.autopilot.state.attitude.tolist()
            tilt = max(tilt, math.acos(1.0 - 2.0 * (x * x + y * y)))
            error = max(error, float(np.linalg.norm(rig.position - place - position)))
    assert math.degrees(tilt) < 40.0
    assert error < 0.5
