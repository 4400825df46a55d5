"""Jerk and yaw acceleration are read from the guidance's motion."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from sitl.autopilot.course import Course
from sitl.autopilot.guidance import Activity
from sitl.values.origin import Origin
from tests.sitl.autopilot_rig import SITE

ORIGIN = Origin(SITE, 47.42, 8.52, 500.0)
JERK, TURNING = np.array([2.0, -1.0, 0.5]), 0.7
ZERO = (0.0, 0.0, 0.0)


def led():
    return SimpleNamespace(activity=Activity.TRACK, motion=(ZERO, ZERO, ZERO), yaw=0.0, yaw_rate=0.0)


@pytest.mark.parametrize("step", [2_500, 5_000, 20_000])
def test_a_constant_jerk_is_found(step):
    guidance = led()
    course = Course(guidance, ORIGIN)
    for k in range(round(1e6 / step)):
        t = k * step * 1e-6
        guidance.motion = (ZERO, ZERO, tuple(JERK * t))
        guidance.yaw_rate = TURNING * t
        reference = course.next(step)
        if k == 0:
            assert reference.jerk.tolist() == [0.0, 0.0, 0.0]
    np.testing.assert_allclose(reference.jerk, ORIGIN.vectors_to_site([JERK])[0], rtol=1e-3)
    assert reference.yaw_acceleration == pytest.approx(TURNING)


@pytest.mark.parametrize("step", [2_500, 20_000, 1_000_000])
def test_a_jump_is_no_jolt(step):
    """However short or long the step in which it comes: at most the jump over the filter's time constant."""
    guidance = led()
    course = Course(guidance, ORIGIN)
    course.next(step)
    guidance.motion = (ZERO, ZERO, (1.0, 0.0, 0.0))
    guidance.yaw_rate = 1.0
    reference = course.next(step)
    assert 0.0 < np.linalg.norm(reference.jerk) <= 10.0
    assert 0.0 < reference.yaw_acceleration <= 1.0 / 0.03


def jerk_after(change, step):
    """The jerk (m/s³) after a change of the acceleration (m/s²) in one step."""
    guidance = led()
    course = Course(guidance, ORIGIN)
    course.next(step)
    guidance.motion = (ZERO, ZERO, (-change, 0.0, 0.0))
    return float(np.linalg.norm(course.next(step).jerk))


@pytest.mark.parametrize("step", [2_500, 20_000, 1_000_000])
@pytest.mark.parametrize("change", [5.0, 7.0])
def test_a_large_step_of_the_acceleration_is_no_jerk(step, change):
    assert jerk_after(change, step) == 0.0


@pytest.mark.parametrize("step", [2_500, 20_000, 1_000_000])
def test_the_share_of_a_step_that_is_jerk_falls_with_its_size(step):
    shares = [jerk_after(change, step) / change for change in (0.5, 1.0, 2.0, 3.0)]
    assert (np.diff(shares) < 0.0).all()
    assert shares[-1] > 0.0


def test_after_a_pause_it_begins_anew():
    guidance = led()
    course = Course(guidance, ORIGIN)
    for acceleration in (0.0, 1.0):
        guidance.motion = (ZERO, ZERO, (acceleration, 0.0, 0.0))
        assert course.next(5_000) is not None
    guidance.activity = Activity.IDLE
    assert course.next(5_000) is None
    assert course.reference is None
    guidance.activity = Activity.TRACK
    assert course.next(5_000).jerk.tolist() == [0.0, 0.0, 0.0]
