"""The disturbance observer on a vehicle of its own kind: drag and wind are found, and the error goes."""

from __future__ import annotations

import numpy as np
import pytest

from companion.config.flight import TrackingConfig
from companion.flight.autopilots import Loop, Shaping
from companion.flight.tracking import Errors, Tracking
from companion.values.horizon import Motion

LOOP = Loop(1.0, 2.0, 4.0)
DT = 0.02


def weave(t):
    """A reference (position, velocity, acceleration) that speeds up and slows down eastwards."""
    w, size = 0.5, 6.0
    east = size * np.array([1.0 - np.cos(w * t), w * np.sin(w * t), w * w * np.cos(w * t)])
    return Motion(*(np.array([part, 0.0, 5.0 * (k == 0)]) for k, part in enumerate(east)))


def flown(config, drag=0.0, wind=0.0, loop=LOOP, bias=0.0, seconds=40.0):
    """Errors (n,) m of a point mass under that loop, whose estimated velocity is off by ``bias``."""
    tracking = Tracking(config)
    x, v = weave(0.0).position.copy(), np.zeros(3)
    off = []
    for k in range(round(seconds / DT)):
        r = weave(k * DT)
        told = Motion(x, v + np.array([bias, 0.0, 0.0]), np.zeros(3))
        tracking.observe(k * round(1e6 * DT), r, told, loop)
        slip = r.velocity + tracking.bias - told.velocity + loop.position * (r.position - x)
        a = r.acceleration + tracking.compensation + loop.velocity * slip
        a = a - drag * (v - np.array([wind, 0.0, 0.0]))
        x, v = x + DT * v + 0.5 * DT * DT * a, v + DT * a
        off.append(np.linalg.norm(x - weave((k + 1) * DT).position))
    return np.array(off), tracking


ON = TrackingConfig(compensate=True, lag=0.0)
OFF = TrackingConfig(lag=0.0)


@pytest.mark.parametrize("drag", [0.3, 1.0])
def test_drag_is_learnt_and_its_error_goes(drag):
    plain, _ = flown(OFF, drag=drag)
    found, tracking = flown(ON, drag=drag)
    assert tracking.drag == pytest.approx(drag, rel=0.25)
    assert np.percentile(found[1000:], 95) < 0.35 * np.percentile(plain[1000:], 95)


def test_wind_is_found():
    plain, _ = flown(OFF, drag=0.3, wind=4.0)
    found, _ = flown(ON, drag=0.3, wind=4.0)
    assert found[1000:].mean() < 0.35 * plain[1000:].mean()


def test_a_vehicle_that_follows_exactly_is_left_alone():
    found, tracking = flown(ON)
    assert found.max() < 0.02
    assert np.linalg.norm(tracking.compensation) < 0.1


def test_a_velocity_that_is_off_is_made_up_for_where_the_autopilot_does_not():
    plain, _ = flown(ON, bias=0.3)
    found, tracking = flown(ON, bias=0.3, loop=LOOP._replace(offset_s=0.5))
    assert found[1500:].mean() < 0.3 * plain[1500:].mean()
    assert tracking.bias == pytest.approx([0.3, 0.0, 0.0], abs=0.02)


def test_a_position_is_pulled_to_its_set_point_faster():
    """After a drag that is not known yet."""
    loop = LOOP._replace(offset_s=0.5)
    slow, _ = flown(ON, drag=1.0, loop=loop, seconds=8.0)
    fast, tracking = flown(ON, drag=1.0, loop=loop._replace(pull=0.5), seconds=8.0)
    assert np.percentile(fast, 95) < 0.9 * np.percentile(slow, 95)
    assert np.linalg.norm(tracking.bias) <= 1.5


def test_only_a_companion_that_compensates_sends_accelerations_early():
    loop = LOOP._replace(lead_us=180_000)
    assert Tracking(ON).lead(loop) == 180_000
    assert Tracking(ON).lead(None) == Tracking(OFF).lead(loop) == 0


def test_a_position_that_jumps_is_no_velocity():
    tracking, loop = Tracking(ON), LOOP._replace(offset_s=0.5)
    still = Motion(*np.zeros((3, 3)))
    tracking.observe(0, still, still, loop)
    tracking.observe(20_000, still, Motion(np.array([5.0, 0.0, 0.0]), np.zeros(3), np.zeros(3)), loop)
    assert np.linalg.norm(tracking.bias) < 0.1


def lag_of_shaping(loop):
    """The compensation (m/s²) for a vehicle that gets an acceleration of 3 m/s² at 5 m/s³ only."""
    tracking = Tracking(ON.model_copy(update={"bandwidth": 5.0}))
    tracking.observe(0, Motion(*np.zeros((3, 3))), Motion(*np.zeros((3, 3))), loop)
    for k in range(1, 25):
        t = k * DT
        r = Motion(*(np.array([part, 0.0, 0.0]) for part in (1.5 * t * t, 3.0 * t, 3.0)))
        measured = Motion(*(np.array([part, 0.0, 0.0]) for part in (5.0 * t**3 / 6.0, 2.5 * t * t, 0.0)))
        tracking.observe(k * round(1e6 * DT), r, measured, loop)
    return float(np.linalg.norm(tracking.compensation))


def test_an_autopilot_with_a_trajectory_of_its_own_is_predicted():
    """What its bounded jerk holds back is not taken for a disturbance."""
    shaped = lag_of_shaping(LOOP._replace(slew=100.0, shaping=Shaping(5.0, 1.0, 2.0)))
    assert shaped < 0.5 * lag_of_shaping(LOOP._replace(slew=100.0))


def test_a_pause_begins_anew():
    _, tracking = flown(ON, drag=1.0, seconds=5.0)
    tracking.reset()
    assert not tracking.compensation.any()
    assert not tracking.bias.any()
    assert tracking.drag > 0.0


def test_errors_are_counted():
    errors = Errors()
    assert errors.percentile(0.95) is None
    for k in range(100):
        errors.add(0.01 * k)
    assert errors.percentile(0.95) == pytest.approx(0.95, abs=0.015)
    assert errors.worst == pytest.approx(0.99)
