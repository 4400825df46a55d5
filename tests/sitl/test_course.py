"""Jerk and yaw acceleration are read from the guidance's motion, and are those of ``Reference.following``."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from autopilot_rig import SITE

from sitl.course import Course
from sitl.guidance import Activity
from sitl.origin import Origin

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


def test_it_reads_as_a_reference_that_follows_another():
    random = np.random.default_rng(1)
    guidance = led()
    course = Course(guidance, ORIGIN)
    before, held = None, 0
    for step in (5_000, 5_000, 2_500, 2_500, 20_000, 5_000):
        guidance.motion = tuple(map(tuple, random.normal(size=(3, 3)).tolist()))
        guidance.yaw, guidance.yaw_rate = random.normal(size=2).tolist()
        expected = course.reference if before is None else course.reference.following(before, held)
        before, held = course.next(step), step
        for seen, value in zip(before, expected, strict=True):
            np.testing.assert_allclose(seen, value, rtol=1e-9, atol=1e-9)


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
