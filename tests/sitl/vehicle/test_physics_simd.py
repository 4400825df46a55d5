"""Eight vehicles side by side calculate what one does, to the bit, also where they part ways."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from sitl.vehicle.airframe import airframe, airframe_record
from sitl.vehicle.angles import cosine_sine, small_cosine_sinc
from sitl.vehicle.compiled import kernel
from sitl.vehicle.config import VehicleConfig
from sitl.vehicle.multirotor import Reference, advance_many, command_row, initial_states
from sitl.vehicle.pipeline import STATE_SIZE
from sitl.vehicle.simd import LANES, at, nearest, put, put_three, some, three_at, where
from sitl.vehicle.vectors import cross, greatest, least

CONFIG = Path(__file__).parents[3] / "config" / "vehicles" / "firefly.yaml"
FIREFLY = VehicleConfig.model_validate(yaml.safe_load(CONFIG.read_text()))
RECORD = airframe_record(airframe(FIREFLY))


@kernel
def everything(row, out):
    """Each operation that lanes have."""
    a, b, c = three_at(row, 0)
    d = at(row, 3)
    put(out, 0, (a + b) * c - d / (1.0 + b * b))
    put(out, 1, math.sqrt(abs(a)) + nearest(-b))
    put(out, 2, where((a < b) & (c >= d) | (a > 2.0), greatest(c, d), least(c, -d)))
    put_three(out, 3, cross((a, b, c), (1.0, d, b)))
    part = 1.0
    if some(a <= 0.0):
        part = where(a <= 0.0, 1.0 / d, part)
    put(out, 6, part)
    c, s = cosine_sine(a)
    put(out, 7, c)
    put(out, 8, s)


@given(st.integers(0, 2**32))
@settings(max_examples=50, deadline=None)
def test_lanes_are_so_many_floats(seed):
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(LANES, 4)) * 10.0 ** rng.uniform(-6.0, 6.0, (LANES, 1))
    block, apart = np.empty((9, LANES)), np.empty((LANES, 9))
    everything(np.ascontiguousarray(rows.T), block)
    for lane in range(LANES):
        everything(rows[lane], apart[lane])
    np.testing.assert_array_equal(block.T, apart)


@given(st.floats(-4e5, 4e5))
@settings(max_examples=300, deadline=None)
def test_cosine_and_sine_are_right_to_some_bits(angle):
    c, s = cosine_sine(angle)
    assert c == pytest.approx(math.cos(angle), abs=3e-15)
    assert s == pytest.approx(math.sin(angle), abs=3e-15)
    assert cosine_sine(-angle) == (c, -s)


@given(st.floats(-1e300, 1e300))
@settings(max_examples=100, deadline=None)
def test_cosine_and_sine_of_anything_are_bounded(angle):
    assert all(abs(value) < 1.0 + 1e-14 for value in cosine_sine(angle))


@given(st.floats(0.0, 0.1))
@settings(max_examples=100, deadline=None)
def test_series_for_small_angles_are_right_to_the_last_bits(angle):
    c, s = small_cosine_sinc(angle * angle)
    assert c == pytest.approx(math.cos(angle), abs=3e-16)
    assert s * angle == pytest.approx(math.sin(angle), abs=3e-17)


def rare(rng):
    """State and command rows (16,) where every kernel takes its rare way for one vehicle or another."""
    places = rng.normal(0.0, 5.0, (16, 3)) - [0.0, 0.0, 20.0]
    states = initial_states(FIREFLY, places, rng.normal(size=16), 0.0)
    states[0, 6:10] = (0.0, 1.0, 0.0, 0.0)  # upside down
    states[1, 10:13] = (90.0, -300.0, 40.0)  # half turns beyond the short series
    states[2, 3:6] = (0.0, 0.0, 60.0)  # about to hit the ground
    states[2, 2] = -0.3
    states[3, 10:13] = (8.0, -8.0, 8.0)  # roll and pitch beyond the rotors
    states[4, 6:10] = (math.sqrt(0.5), 0.0, -math.sqrt(0.5), 0.0)  # the nose straight down
    states[5, 2] = 0.0  # on the ground
    states[6, 20:26] = (100.0, -50.0, 30.0, 5.0, -5.0, 1.0)  # disturbances beyond their bounds
    states[7:9, 6:10] = (1.0, 0.0, 0.0, 0.0)
    states[:, STATE_SIZE + 6 :] = np.where(rng.random((16, 6)) < 0.1, rng.random((16, 6)), 1.0)
    commands = []
    for k in range(16):
        p, v, a, j, s = rng.normal(0.0, [[5.0], [2.0], [1.0], [0.5], [0.5]], (5, 3))
        reference = Reference(p - [0.0, 0.0, 20.0], v, a, j, s, *rng.normal(0.0, 2.0, 3))
        if k == 7:  # weightless
            reference = Reference(places[k], acceleration=np.array([0.0, 0.0, 9.80665]))
        if k == 8:  # on its side, as b1d is the other way
            reference = Reference(places[k], acceleration=np.array([0.0, -20.0, 9.80665]))
        if k == 9:  # beyond the greatest tilt and thrust
            reference = reference._replace(position=np.array([300.0, 0.0, -900.0]))
        commands.append(command_row(None if k in (10, 11) else reference, idle=k == 10))
    return states, np.array(commands)


@pytest.mark.parametrize("limits", [{}, {"max_tilt_deg": None}, {"max_tilt_deg": None, "heading": "paper"}])
@pytest.mark.parametrize("seed", range(4))
def test_who_needs_a_rare_way_leaves_the_others_as_they_are(seed, limits):
    record = airframe_record(airframe(FIREFLY.model_copy(update=limits)))
    rng = np.random.default_rng(seed)
    states, commands = rare(rng)
    order = rng.permutation(16)
    together = np.ascontiguousarray(states[order])
    track = advance_many(together, np.ascontiguousarray(commands[order]), record, 60)
    assert np.all(np.isfinite(together))
    for place, k in enumerate(order):
        alone = states[k : k + 1].copy()
        np.testing.assert_array_equal(advance_many(alone, commands[k : k + 1], record, 60)[0], track[place])
        np.testing.assert_array_equal(alone[0], together[place])


def test_a_block_that_is_not_full_gives_back_its_own_vehicles_only():
    rng = np.random.default_rng(5)
    states, commands = rare(rng)
    eleven = np.ascontiguousarray(states[:11])
    track = advance_many(eleven, np.ascontiguousarray(commands[:11]), RECORD, 5)
    assert track.shape == (11, 5, 3)
    np.testing.assert_array_equal(track[:, -1], eleven[:, 0:3])
