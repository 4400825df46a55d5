"""Who tells of the target: each kind gives the same track, one speaker counts, what is absurd is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError
from pymavlink.dialects.v20 import all as mavlink

from companion.config import CompanionConfig
from companion.config.estimation import TrackConfig
from companion.estimation.target import Target
from companion.estimation.tracks import Track
from companion.telemetry.reception import accepts
from mavlink_bridge.messages import BY_TYPE, CameraTrackingGeo, FollowTarget, GlobalPosition, Source
from tests.companion.bench import FLEET, START, SYSTEM, TARGET, Bench
from tests.companion.rig import LAWS, QUICK, numbers, vectors

CAMERA = Source(SYSTEM, 100)
PHONE = Source(TARGET, 1)
PERIOD = 100_000
KINDS = ("global_position", "follow_target", "camera")
MESSAGES = {
    "global_position": mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
    "follow_target": mavlink.MAVLINK_MSG_ID_FOLLOW_TARGET,
    "camera": mavlink.MAVLINK_MSG_ID_CAMERA_TRACKING_GEO_STATUS,
}


def target(kind="global_position", **more):
    config = CompanionConfig.model_validate({"target_source": {"kind": kind, **more}})
    return Target(config, SYSTEM, TARGET, FLEET)


def told(kind, x, v, boot=0, source=None):
    """The message of that kind of a target at ``x`` with ``v`` (ENU; None: not said), and its link."""
    place = FLEET.to_geodetic(x)
    ned = None if v is None else (float(v[1]), float(v[0]), float(-v[2]))
    if kind == "follow_target":
        return "target", FollowTarget(source or PHONE, boot, *place, ned)
    if kind == "camera":
        return "autopilot", CameraTrackingGeo(source or CAMERA, 1, *place, ned)
    return "target", GlobalPosition(source or PHONE, boot, *place, 0.0, ned or (0.0, 0.0, 0.0), None)


def followed(kind, x, v, seconds=8.0, says_velocity=True, noise=None):
    """A target that was told of, and when for the last time."""
    found, now = target(kind), START
    for k in range(round(seconds * 10)):
        now = START + k * PERIOD
        place = x + 1e-6 * (now - START) * v + (0.0 if noise is None else noise.normal(0.0, 0.3, 3))
        delay = found._config.target.delay_us
        message = told(kind, place, v if says_velocity else None, 10**6 + k * PERIOD)
        assert found.receive(now + delay, *message)
    return found, now


@QUICK
@given(x=vectors(50.0), v=vectors(4.0), kind=st.sampled_from(KINDS))
def test_every_kind_tells_the_same(x, v, kind):
    found, now = followed(kind, x, v)
    state = found.at(now)
    np.testing.assert_allclose(state.position, x + 7.9 * v, atol=0.02)
    np.testing.assert_allclose(state.velocity, v, atol=0.02)
    assert state.age == 0


@QUICK
@given(x=vectors(50.0), v=vectors(4.0), kind=st.sampled_from(KINDS[1:]), seed=st.integers(0, 99))
def test_a_velocity_that_nobody_tells_is_found_from_the_places(x, v, kind, seed):
    """Within what the filter says of itself, of a target whose places are noisy."""
    found, now = followed(kind, x, v, 20.0, says_velocity=False, noise=np.random.default_rng(seed))
    state, P = found.at(now), found._track.covariance(now)
    assert np.linalg.norm(state.position - x - 19.9 * v) < 4.0 * math.sqrt(np.trace(P[:3, :3]))
    assert np.linalg.norm(state.velocity - v) < 4.0 * math.sqrt(np.trace(P[3:, 3:]))
    assert state.turn_rate == 0.0


def test_three_zeros_are_no_velocity():
    moving, still = (followed("follow_target", np.zeros(3), np.array([2.0, 0.0, 0.0]))[0] for _ in range(2))
    link, message = told("follow_target", np.array([16.0, 0.0, 0.0]), np.zeros(3), 10**6 + 80 * PERIOD)
    assert still.receive(START + 80 * PERIOD + 20_000, link, message)
    at = START + 80 * PERIOD
    np.testing.assert_allclose(still.at(at).velocity, moving.at(at).velocity, atol=0.05)


@LAWS
@given(steps=st.lists(st.tuples(vectors(3.0), st.integers(0, 400_000), st.booleans()), max_size=30))
def test_a_track_that_misses_velocities_knows_less_and_stays_sane(steps):
    config = TrackConfig(sigma_position=1.0, jump=100.0, gate=1e4)
    whole, partly = Track(config), Track(config)
    now, zero = START, np.zeros(3)
    for place, elapsed, says in [(zero, 0, True), *steps]:
        now += elapsed
        whole.measure(now, place, zero)
        partly.measure(now, place, zero if says else None)
        P, Q = whole.covariance(), partly.covariance()
        assert (np.linalg.eigvalsh(Q - P) >= -1e-6).all()
        assert np.isfinite(partly.last).all()


def test_a_place_far_off_the_way_needs_a_witness():
    found, now = followed("camera", np.zeros(3), np.array([1.0, 0.0, 0.0]), says_velocity=False)
    far = told("camera", np.array([60.0, 0.0, 0.0]), None)
    assert not found.receive(now + 120_000, *far)
    assert found.at(now).position[0] == pytest.approx(7.9, abs=0.3)
    assert found.receive(now + 220_000, *far)
    assert found.at(now + 200_000).position[0] == pytest.approx(60.0, abs=0.5)


@pytest.mark.parametrize("kind", KINDS)
def test_another_kind_changes_nothing(kind):
    found, now = followed(kind, np.zeros(3), np.array([1.0, 0.0, 0.0]))
    before = found.at(now + PERIOD)
    for other in set(KINDS) - {kind}:
        speaker = Source(CAMERA.system if other == "camera" else TARGET, 7)
        assert not found.receive(now + PERIOD, *told(other, np.ones(3), np.ones(3), source=speaker))
    after = found.at(now + PERIOD)
    np.testing.assert_array_equal(after.position, before.position)


@pytest.mark.parametrize("anyone", [False, True])
def test_of_two_that_speak_the_first_counts_until_it_is_silent(anyone):
    """Else a phone and the autopilot beside it would pull the track to and fro."""
    found = target("follow_target", anyone=anyone)
    other = Source(7 if anyone else TARGET, 20)
    here, there = np.zeros(3), np.array([5.0, 0.0, 0.0])
    assert found.receive(START, *told("follow_target", here, None))
    for k in range(1, 20):
        now = START + k * PERIOD
        assert not found.receive(now, *told("follow_target", there, None, source=other))
        assert found.receive(now, *told("follow_target", here, None))
    assert found.refused == 19
    now += found._config.guard.target_stale_us + 1
    assert found.at(now) is None
    assert found.receive(now, *told("follow_target", there, None, source=other))
    np.testing.assert_allclose(found.at(now).position, there, atol=1e-3)


def test_what_was_known_last_stays_until_the_next_speaker_makes_sense():
    found = target("follow_target", anyone=True)
    here, there = np.zeros(3), np.array([5.0, 0.0, 0.0])
    assert found.receive(START, *told("follow_target", here, None))
    link, sense = told("follow_target", there, None, source=Source(7, 20))
    for later in (10, 20):
        now = START + later * 10**6
        assert not found.receive(now, link, sense._replace(latitude=-47.0, longitude=-171.0))
        assert found.at(now) is None
        np.testing.assert_allclose(found.last(now).position, here, atol=1e-3)
        assert found.age(now) > later * 10**6
    assert found.receive(now, link, sense)
    np.testing.assert_allclose(found.last(now).position, there, atol=1e-3)


@pytest.mark.parametrize("avoidance", ["field", "certified"])
@pytest.mark.parametrize("silent", [False, True])
def test_nobody_flies_through_a_target_whether_it_is_heard_or_not(avoidance, silent):
    bench = Bench(avoidance=avoidance, target_d_min=2.0, target_d_safe=4.0)
    place = np.array([6.0, 0.3, 5.0])
    bench.target = told("global_position", place, None)[1]
    bench.take_off().fly(1.0)
    if silent:
        bench.target = None
        bench.fly(1e-6 * bench.config.guard.target_stale_us + 1.0)
    bench.go_to((12.0, 0.0, 5.0))
    for _ in range(100):
        bench.fly(0.1)
        assert np.linalg.norm(bench.autopilot.position - place) > 2.0
    assert bench.autopilot.position[0] > 3.0


@pytest.mark.parametrize("source", [Source(0, 1), Source(2, 1), Source(SYSTEM, 1)])
def test_strangers_are_no_target(source):
    assert not target("follow_target").receive(
        START, *told("follow_target", np.zeros(3), None, source=source)
    )
    reachable = source.system == 2
    anyone = target("follow_target", anyone=True)
    assert anyone.receive(START, *told("follow_target", np.zeros(3), None, source=source)) == reachable


def test_a_camera_that_does_not_track_tells_nothing():
    link, message = told("camera", np.zeros(3), None)
    for status in (0, 2, 255):
        assert not target("camera").receive(START, link, message._replace(status=status))
    assert target("camera").receive(START, link, message)


@given(numbers(-100.0, 100.0), st.integers(0, 10**9))
def test_a_fixed_target_is_always_there(x, later):
    found = target("fixed", at=(x, 1.0, 2.0))
    state = found.at(START + later)
    np.testing.assert_array_equal(state.position, (x, 1.0, 2.0))
    assert (state.age, found.age(START + later)) == (0, 0)
    assert not found.receive(START, *told("global_position", np.zeros(3), np.zeros(3)))


@given(
    st.sampled_from((*KINDS, "fixed")),
    st.booleans(),
    st.sampled_from(("autopilot", "swarm", "target", "ground")),
    st.sampled_from([BY_TYPE[kind].id for kind in (GlobalPosition, FollowTarget, CameraTrackingGeo)]),
    st.integers(0, 20),
    st.sampled_from((1, 100, 195)),
)
def test_a_header_that_is_let_through_is_one_that_may_count(kind, anyone, link, message, system, component):
    settings = {"kind": kind, **({"anyone": anyone} if kind in KINDS[:2] else {})}
    settings |= {"at": (0.0, 0.0, 0.0)} if kind == "fixed" else {}
    config = CompanionConfig.model_validate({"target_source": settings})
    passes = accepts(link, SYSTEM, TARGET, config)(message, system, component)
    of_kind = message == MESSAGES.get(kind)
    if link == "target":
        right = system == (SYSTEM if kind == "camera" else TARGET)
        assert passes == (of_kind and (right or (anyone and kind != "camera")))
    elif link == "autopilot":
        assert passes == (of_kind and kind == "camera" and system == SYSTEM)
    elif link == "swarm":
        assert passes == (message == mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT and system != SYSTEM)
    else:
        assert not passes


@pytest.mark.parametrize(
    ("wrong", "naming"),
    [
        ({"kind": "fixed"}, "at"),
        ({"kind": "fixed", "at": (0.0, 0.0, math.nan)}, "at"),
        ({"kind": "camera", "system": 0}, "system"),
        ({"kind": "radar"}, "radar"),
        ({"kind": "global_position", "at": (0, 0, 0)}, "at"),
    ],
)
def test_what_is_wrong_is_named(wrong, naming):
    with pytest.raises(ValidationError, match=naming):
        CompanionConfig.model_validate({"target_source": wrong})


@pytest.mark.parametrize("source", [{"kind": "fixed", "at": (8.0, 0.0, 0.0)}, {"kind": "follow_target"}])
def test_a_companion_escorts_it(source):
    bench = Bench(task="escort", target_source=source)
    bench.target = told("follow_target", np.array([8.0, 0.0, 0.0]), None)[1]
    bench.take_off(5.0).fly(12.0)
    distance = np.linalg.norm(bench.autopilot.position[:2] - (8.0, 0.0))
    assert distance == pytest.approx(bench.config.surface.radius, abs=0.3)
