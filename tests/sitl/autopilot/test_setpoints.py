"""How each dialect reads a set-point: tables of masks and frames, and laws over all of them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from sitl.autopilot.firmware import Firmware
from sitl.autopilot.firmware.ardupilot import ArduPilot
from sitl.autopilot.firmware.px4 import Px4
from sitl.config.autopilot import AutopilotConfig
from sitl.values.setpoints import ACCELERATION, POSITION, VELOCITY, Pose, Refusal, Setpoint, Stop, mask_of
from tests.sitl.autopilot_rig import FLAVOURS, SITE, ZERO, setpoint

CONFIG = AutopilotConfig(system_id=1, latitude=SITE.latitude, longitude=SITE.longitude)
READERS: dict[str, Firmware] = {"ardupilot": ArduPilot(CONFIG), "px4": Px4(CONFIG)}
HERE = Pose((10.0, 20.0, -30.0), 0.5)
P, V, A = (1.0, 2.0, -3.0), (4.0, 5.0, -6.0), (0.1, 0.2, -0.3)


class Mask(NamedTuple):
    """A mask in frame 1 and the level of its axes, or Stop or Refusal."""

    mask: int
    ardupilot: object
    px4: object


PPP, VVV, AAA = (POSITION,) * 3, (VELOCITY,) * 3, (ACCELERATION,) * 3
MASKS = [
    Mask(0xDF8, PPP, PPP),
    Mask(0x9F8, PPP, PPP),
    Mask(0x9C0, PPP, PPP),
    Mask(0xDC7, VVV, VVV),
    Mask(0x9C7, VVV, VVV),
    Mask(0xC07, VVV, VVV),
    Mask(0xC3F, AAA, AAA),
    Mask(0xDC0, PPP, PPP),
    Mask(0xC00, PPP, PPP),
    Mask(0x000, PPP, PPP),
    # Position and acceleration without velocity; yaw only; nothing; forced.
    Mask(0xC38, Stop, PPP),
    Mask(0x9FF, Stop, Refusal),
    Mask(0xFFF, Stop, Refusal),
    # MAVProxy's velocity command sets the force bit, which ArduPilot does not look at.
    Mask(0xFC7, VVV, Refusal),
    # Height by position, the rest by velocity: per axis for PX4, a dropped triple for ArduPilot.
    Mask(0xDC3 | 0x20, Stop, (VELOCITY, VELOCITY, POSITION)),
    Mask(0xDC3, VVV, (VELOCITY, VELOCITY, POSITION)),
    # One free axis; x without y.
    Mask(0xDFC, Stop, Refusal),
    Mask(0xDF9, Stop, Refusal),
    Mask(0xDC6, VVV, Refusal),
]


@pytest.mark.parametrize("flavour", FLAVOURS)
@pytest.mark.parametrize("case", MASKS, ids=lambda case: f"0x{case.mask:03X}")
def test_masks(flavour, case):
    expected = getattr(case, flavour)
    reading = READERS[flavour].read(setpoint(case.mask, P, V, A), HERE)
    if isinstance(expected, tuple):
        assert isinstance(reading, Setpoint)
        assert reading.levels == expected
    else:
        assert isinstance(reading, expected)


@pytest.mark.parametrize("flavour", FLAVOURS)
@pytest.mark.parametrize("mask", [0xDF8, 0xDC7, 0xDC0, 0xC00, 0xC07, 0xC3F, 0x9C0])
def test_the_echoed_mask_is_the_mask(flavour, mask):
    reading = READERS[flavour].read(setpoint(mask, P, V, A), HERE)
    assert isinstance(reading, Setpoint)
    assert mask_of(reading) == mask


def along_body(v):
    c, s = math.cos(HERE.yaw), math.sin(HERE.yaw)
    return (c * v[0] - s * v[1], s * v[0] + c * v[1], v[2])


FRAMES = [
    ("ardupilot", 1, P, V, 0.3),
    ("ardupilot", 7, tuple(np.add(HERE.position, P)), V, 0.3),
    ("ardupilot", 8, tuple(np.add(HERE.position, along_body(P))), along_body(V), 0.8),
    ("ardupilot", 9, tuple(np.add(HERE.position, along_body(P))), along_body(V), 0.8),
    ("px4", 1, P, V, 0.3),
]


@pytest.mark.parametrize(("flavour", "frame", "position", "velocity", "yaw"), FRAMES)
def test_frames(flavour, frame, position, velocity, yaw):
    reading = READERS[flavour].read(setpoint(0x9C0, P, V, yaw=0.3, frame=frame), HERE)
    assert isinstance(reading, Setpoint)
    np.testing.assert_allclose(reading.position, position, atol=1e-12)
    np.testing.assert_allclose(reading.velocity, velocity, atol=1e-12)
    assert reading.yaw == pytest.approx(yaw)


def test_px4_takes_velocity_but_no_position_in_the_body_frame():
    reading = READERS["px4"].read(setpoint(0x9C7, velocity=V, frame=8), HERE)
    assert isinstance(reading, Setpoint)
    np.testing.assert_allclose(reading.velocity, along_body(V))
    assert isinstance(READERS["px4"].read(setpoint(0x9F8, P, frame=8), HERE), Refusal)


@given(frame=st.integers(0, 255), mask=st.integers(0, 0xFFFF))
def test_unknown_frames_never_steer(frame, mask):
    assume(frame not in (1, 7, 8, 9))
    for reader in READERS.values():
        assert not isinstance(reader.read(setpoint(mask, P, V, A, frame=frame), HERE), Setpoint)


BAD = st.sampled_from((math.nan, math.inf, -math.inf, 1e30, -3e38))


@given(
    flavour=st.sampled_from(FLAVOURS),
    frame=st.sampled_from((1, 7, 8, 9)),
    mask=st.integers(0, 0xFFF),
    field=st.integers(0, 10),
    bad=BAD,
)
def test_a_bad_number_is_refused_where_it_is_used_and_harmless_where_it_is_not(
    flavour, frame, mask, field, bad
):
    read = READERS[flavour].read
    values = [*P, *V, *A, 0.3, 0.1]

    def message(numbers):
        p, v, a = (tuple(numbers[i : i + 3]) for i in (0, 3, 6))
        return setpoint(mask, p, v, a, numbers[9], numbers[10], frame=frame)

    whole = read(message(values), HERE)
    values[field] = bad
    spoilt = read(message(values), HERE)
    bit = (1 << field) if field < 9 else 0x400 << (field - 9)
    if not mask & bit and isinstance(whole, Setpoint):
        triple = 7 << field // 3 * 3 if field < 9 else bit
        dropped = flavour == "ardupilot" and mask & triple
        assert spoilt == whole if dropped else isinstance(spoilt, Refusal)
    elif mask & bit:
        assert spoilt == whole
    else:
        assert not isinstance(spoilt, Setpoint)


VECTORS = st.tuples(*[st.floats(-20, 20)] * 3)
TIMES = st.floats(0, 3)


@given(p=VECTORS, v=VECTORS, a=VECTORS, s=TIMES, t=TIMES)
def test_extrapolation_is_one_motion(p, v, a, s, t):
    """Later of later is latest, while the acceleration acts; then the velocity is kept."""
    motion = Setpoint(PPP, p, v, a, 0.2, 0.1, complete=True)
    direct, twice = motion.after(s + t, 9.0), motion.after(s, 9.0).after(t, 9.0)
    np.testing.assert_allclose(direct.position, twice.position, atol=1e-9)
    np.testing.assert_allclose(direct.velocity, twice.velocity, atol=1e-9)
    assert direct.yaw == pytest.approx(twice.yaw)
    coasting, turning = motion.after(s + t, s), motion.after(s, s)
    np.testing.assert_allclose(coasting.velocity, turning.velocity)
    np.testing.assert_allclose(
        np.subtract(coasting.position, turning.position), np.multiply(t, turning.velocity), atol=1e-9
    )


@given(v=VECTORS, a=VECTORS, speed=st.floats(0.1, 40), acceleration=st.floats(0.1, 40))
def test_limits_bound_norms_and_keep_directions(v, a, speed, acceleration):
    motion = Setpoint(PPP, ZERO, v, a, complete=True)
    limited = motion.limited(speed, acceleration)
    for before, after, most in ((v, limited.velocity, speed), (a, limited.acceleration, acceleration)):
        assert np.linalg.norm(after) <= most * (1 + 1e-5)
        np.testing.assert_allclose(np.cross(before, after), 0.0, atol=1e-9)
    assert limited.complete == (limited == motion)
