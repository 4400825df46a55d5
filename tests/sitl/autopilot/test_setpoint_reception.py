"""Set-points in flight: followed when good, never when bad, not for ever when they stop."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mavlink_bridge.messages import Heartbeat, PositionTarget, SetpointLocal, StatusText, SysStatus
from sitl.autopilot.firmware import Mode
from tests.sitl.autopilot_rig import (
    ALL,
    ARM,
    FLAVOURS,
    LAND,
    POSITION_YAW,
    SET_MODE,
    VELOCITY_YAW,
    ZERO,
    Rig,
    setpoint,
    within,
)

CHECK = 401
"""RUN_PREARM_CHECKS."""
CALM = settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
BAD = st.sampled_from((math.nan, math.inf, -math.inf, 3e38))
ANY = st.one_of(BAD, st.floats(-50, 50, width=32))


@pytest.fixture(scope="module", params=FLAVOURS)
def hovering(request):
    """One vehicle for all examples of a law that says that it stays where it is."""
    rig = Rig(request.param).hover(5.0)
    place = (0.0, 0.0, -5.0)
    rig.steer(2.0, setpoint(ALL, place))
    return rig


def assert_unmoved_and_answered(rig, message):
    """Streams the message for 0.6 s, after a second in which every complaint becomes due again."""
    good = setpoint(ALL, (0.0, 0.0, -5.0))
    rig.run(1.0, good)
    rig.received.clear()
    tracks = []
    for k in range(120):
        rig.step(*((message, good) if k % 4 == 0 else ()))
        tracks += rig.autopilot.trace.tolist()
    assert within(tracks, (0.0, 0.0, -5.0), 0.02)
    assert rig.autopilot.mode is Mode.GUIDED
    answers = [m for m in rig.all(StatusText) if m.severity == 4]
    assert len(answers) == 1
    assert answers[0].text.startswith("Set-point")


@CALM
@given(mask=st.integers(0, 0xFFF), frame=st.integers(0, 255), bad=BAD)
def test_a_set_point_of_bad_numbers_never_moves_it(hovering, mask, frame, bad):
    bad3 = (bad, bad, bad)
    assert_unmoved_and_answered(hovering, setpoint(mask, bad3, bad3, bad3, bad, bad, frame=frame))


@CALM
@given(frame=st.integers(0, 255).filter(lambda frame: frame not in (1, 7, 8, 9)), mask=st.integers(0, 0xFFFF))
def test_a_set_point_in_an_unknown_frame_never_moves_it(hovering, frame, mask):
    message = setpoint(mask, (30.0, 0.0, -5.0), (5.0, 0.0, 0.0), (3.0, 0.0, 0.0), frame=frame)
    assert_unmoved_and_answered(hovering, message)


CONTRADICTIONS = {
    "ardupilot": (0xC38, 0xDFF, 0xFFF, 0x9FF, 0xDF9, 0xDFB | 0x24, 0xC3F | 0x40),
    "px4": (0x200, 0xDFF, 0xFFF, 0x9FF, 0xDF9, 0xDFE, 0xC3F | 0x40, 0xDC6),
}


def test_a_contradictory_mask_never_moves_it(hovering):
    for mask in CONTRADICTIONS[hovering.flavour]:
        message = setpoint(mask, (30.0, 0.0, -5.0), (5.0, 0.0, 0.0), (3.0, 0.0, 0.0))
        assert_unmoved_and_answered(hovering, message)


@CALM
@given(
    flavour=st.sampled_from(FLAVOURS),
    numbers=st.tuples(*[ANY] * 11),
    mask=st.integers(0, 0xFFFF),
    frame=st.sampled_from((1, 7, 8, 9)),
)
def test_whatever_comes_the_flight_stays_finite_and_bounded(flavour, numbers, mask, frame):
    rig = Rig(flavour).hover(2.5)
    rig.step(setpoint(position=(0.0, 0.0, -2.5)))
    rig.guided()
    message = setpoint(mask, numbers[0:3], numbers[3:6], numbers[6:9], *numbers[9:], frame=frame)
    rig.run(1.0, message)
    assert np.all(np.isfinite(rig.position))
    assert np.all(np.isfinite(rig.autopilot.state.attitude))
    assert rig.speed < rig.config.max_acceleration * 1.2


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_bad_set_point_leaves_the_flight_as_it_was(flavour):
    """In the middle of a dash: the same track with and without garbage in between."""
    tracks = []
    for spoilt in (False, True):
        rig = Rig(flavour).hover(5.0)
        good = setpoint(VELOCITY_YAW, velocity=(2.0, 0.0, 0.0))
        bad = setpoint(ALL, (math.nan, 0.0, 0.0))
        rig.step(good)
        rig.guided()
        for _ in range(100):
            rig.step(good, *([bad] if spoilt else ()))
        tracks.append(rig.position.tolist())
    assert tracks[0] == tracks[1]


def test_complaints_come_once_per_reason_and_second():
    rig = Rig("ardupilot").hover(3.0)
    rig.received.clear()
    rig.run(3.0, setpoint(frame=0), setpoint(POSITION_YAW, (math.nan, 0.0, 0.0)))
    assert sorted(rig.texts) == 3 * ["Set-point refused: position not a number"] + 3 * [
        "Set-point stops: frame 0"
    ]


def test_ardupilot_brakes_where_it_understands_stop():
    rig = Rig("ardupilot").hover(5.0)
    rig.steer(3.0, setpoint(VELOCITY_YAW, velocity=(3.0, 0.0, 0.0)))
    before = rig.position
    rig.step(setpoint(VELOCITY_YAW, velocity=(3.0, 0.0, 0.0), frame=12))
    rig.run(6.0)
    assert rig.speed < 0.01
    assert 2.0 < rig.position[0] - before[0] < 5.0


def test_set_points_outside_guided_do_nothing():
    for flavour in FLAVOURS:
        rig = Rig(flavour).hover(4.0)
        rig.order(176, *((1, 5) if flavour == "ardupilot" else (1, 4, 3)))
        rig.received.clear()
        rig.run(1.0, setpoint(position=(9.0, 9.0, -9.0)))
        np.testing.assert_allclose(rig.position, [0, 0, -4], atol=0.03)
        assert rig.texts == (["Set-point ignored: not in GUIDED"] if flavour == "ardupilot" else [])


def drifted(rig, message, seconds):
    """Distance covered after the last set-point of a stream, and whether it then stands."""
    rig.steer(6.0, message)
    start = rig.position
    rig.run(seconds)
    return float(np.linalg.norm(rig.position - start)), rig.speed < 0.02


def test_ardupilot_keeps_the_velocity_for_three_seconds_and_then_brakes():
    rig = Rig("ardupilot").hover(5.0)
    distance, stands = drifted(rig, setpoint(VELOCITY_YAW, velocity=(2.0, 0.0, 0.0)), 12.0)
    assert 6.0 + 0.9 < distance < 8.5
    assert stands
    assert rig.autopilot.mode is Mode.GUIDED
    assert "Set-points timed out" in rig.texts


def test_ardupilot_flies_to_a_position_for_ever():
    rig = Rig("ardupilot").hover(5.0)
    rig.step(setpoint(position=(60.0, 0.0, -5.0)))
    rig.run(15.0)
    np.testing.assert_allclose(rig.position, [60, 0, -5], atol=0.05)
    assert "Set-points timed out" not in rig.texts


@pytest.mark.parametrize("loss", ["hold", "land", "descend"])
def test_px4_leaves_offboard_after_one_second(loss):
    rig = Rig("px4", offboard_loss=loss).hover(5.0)
    distance, stands = drifted(
        rig, setpoint(VELOCITY_YAW, velocity=(2.0, 0.0, 0.0)), 8.0 if loss == "hold" else 3.0
    )
    assert "Set-points timed out" in rig.texts
    if loss == "hold":
        assert 2.0 + 0.9 < distance < 4.5
        assert stands
        assert rig.autopilot.mode is Mode.HOLD
    else:
        assert rig.autopilot.mode is {"land": Mode.LAND, "descend": Mode.POSITION}[loss]
        assert rig.autopilot.state.velocity[2] == pytest.approx(0.8 if loss == "land" else 0.6, abs=0.05)
        rig.run(8.0)
        assert not rig.autopilot.armed


def test_px4_position_set_points_time_out_too():
    rig = Rig("px4").hover(5.0)
    rig.steer(1.0, setpoint(position=(60.0, 0.0, -5.0)))
    rig.run(12.0)
    assert rig.speed < 0.1
    assert rig.position[0] < 50.0
    assert rig.autopilot.mode is Mode.HOLD


@pytest.mark.parametrize(("hz", "result"), [(50.0, 0), (4.0, 0), (1.0, 1)])
def test_offboard_wants_a_stream_of_more_than_two_hertz(hz, result):
    rig = Rig("px4").hover(5.0)
    message = setpoint(position=(0.0, 0.0, -5.0))
    rig.run(3.0, message, hz=hz)
    rig.step(message)
    assert rig.guided() == [result]


def test_offboard_is_denied_after_the_stream_has_stopped():
    rig = Rig("px4").hover(5.0)
    rig.run(2.0, setpoint(position=(0.0, 0.0, -5.0)))
    rig.run(0.6)
    assert rig.guided() == [1]
    assert rig.texts[-1] == "OFFBOARD needs set-points at more than 2 Hz"


def circle(t, radius=4.0, rate=0.5):
    c, s = math.cos(rate * t), math.sin(rate * t)
    return setpoint(
        ALL,
        (radius * s, radius * (1 - c), -5.0),
        (radius * rate * c, radius * rate * s, 0.0),
        (-radius * rate**2 * s, radius * rate**2 * c, 0.0),
        yaw=rate * t,
        yaw_rate=rate,
    )


@pytest.mark.parametrize("flavour", FLAVOURS)
@pytest.mark.parametrize("hz", [50.0, 5.0])
def test_a_trajectory_is_tracked_whatever_its_rate(flavour, hz):
    rig = Rig(flavour).hover(5.0)
    rig.steer(1.0, circle(0.0)._replace(velocity=ZERO, acceleration=ZERO, yaw_rate=0.0))
    start, pause, worst = rig.now, round(200 / hz), []
    for k in range(2000):
        t = (rig.now - start) * 1e-6
        rig.step(*([circle(t)] if k % pause == 0 else ()))
        if t > 5.0:
            worst.append(np.linalg.norm(rig.position - circle(t).position))
    assert max(worst) < 0.1
    assert rig.autopilot.reference.position == pytest.approx(circle(t).position, abs=0.05)


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_far_jump_of_a_trajectory_is_flown_within_limits(flavour):
    rig = Rig(flavour).hover(5.0)
    rig.steer(1.0, setpoint(ALL, (0.0, 0.0, -5.0)))
    far, speeds, references = setpoint(ALL, (30.0, 0.0, -5.0)), [], []
    for k in range(2400):
        rig.step(*([far] if k % 4 == 0 else ()))
        speeds.append(rig.speed)
        references.append(rig.autopilot.reference.position)
    steps = np.linalg.norm(np.diff(references, axis=0), axis=1)
    assert steps.max() < 0.1
    assert max(speeds) < 1.05 * rig.config.max_speed
    np.testing.assert_allclose(rig.position, [30, 0, -5], atol=0.05)


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_landing_ends_the_say_of_set_points(flavour):
    rig = Rig(flavour).hover(3.0)
    stay = setpoint(position=(0.0, 0.0, -3.0))
    rig.steer(1.0, stay)
    rig.order(LAND)
    rig.run(9.0, stay)
    assert not rig.autopilot.armed


@pytest.mark.parametrize(("flavour", "yaws"), [("ardupilot", 0), ("px4", 1)])
def test_what_is_followed_is_echoed(flavour, yaws):
    rig = Rig(flavour).hover(5.0)
    rig.received.clear()
    rig.steer(2.0, setpoint(ALL, (0.0, 0.0, -5.0), yaw=0.5))
    echoes = rig.all(PositionTarget)
    assert len(echoes) == 20
    assert echoes[-1].position == (0.0, 0.0, -5.0)
    assert (echoes[-1].type_mask & 0x400 == 0) == bool(yaws)


@pytest.mark.parametrize("loss", ["hold", "descend", "return"])
def test_px4_goes_on_with_offboard_when_its_set_points_come_back(loss):
    rig = Rig("px4", offboard_loss=loss).hover(5.0)
    north = setpoint(VELOCITY_YAW, velocity=(1.0, 0.0, 0.0))
    rig.steer(2.0, north)
    rig.run(2.0)
    assert rig.autopilot.mode is not Mode.GUIDED
    rig.run(1.0, setpoint(POSITION_YAW, frame=7))
    assert rig.autopilot.mode is not Mode.GUIDED
    rig.run(4.0, north)
    assert rig.autopilot.mode is Mode.GUIDED
    assert rig.speed == pytest.approx(1.0, abs=0.1)


def test_a_mode_that_was_asked_for_is_not_left_when_set_points_come_back():
    rig = Rig("px4", offboard_loss="hold").hover(5.0)
    north = setpoint(VELOCITY_YAW, velocity=(1.0, 0.0, 0.0))
    rig.steer(2.0, north)
    rig.run(2.0)
    assert rig.order(LAND) == [0]
    rig.run(1.0, north)
    assert rig.autopilot.mode is Mode.LAND


def test_px4_comes_back_to_the_mode_that_was_chosen_on_the_ground():
    rig = Rig("px4")
    rig.run(1.1)
    # Any mode can be chosen there, but OFFBOARD does not arm without set-points.
    assert rig.guided() == [0]
    assert rig.order(ARM, 1) == [4]
    up = setpoint(POSITION_YAW, (0.0, 0.0, -3.0))
    rig.run(1.0, up)
    assert rig.order(ARM, 1) == [0]
    rig.run(5.0, up)
    assert rig.position[2] < -2.0
    assert rig.order(LAND) == [0]
    rig.run(15.0)
    assert not rig.autopilot.armed
    assert rig.autopilot.mode is Mode.GUIDED


def test_px4_comes_back_to_offboard_after_a_landing_and_fails_its_checks_there_without_set_points():
    """As PX4 1.16.1 does: the last mode that was chosen and may be armed in, in the air too."""
    rig = Rig("px4").hover(3.0)
    stay = setpoint(POSITION_YAW, (0.0, 0.0, -3.0))
    rig.steer(2.0, stay)
    assert rig.order(LAND) == [0]
    rig.run(12.0)
    assert not rig.autopilot.armed
    assert rig.autopilot.mode is Mode.GUIDED

    def passes():
        rig.received.clear()
        rig.run(1.1, *every)
        return bool(rig.all(SysStatus)[-1].health & 0x10000000)

    every: tuple[SetpointLocal, ...] = ()
    assert not passes()
    rig.received.clear()
    assert rig.order(CHECK) == [0]
    assert rig.texts == ["Preflight Fail: no offboard signal"]
    every = (stay,)
    assert passes()
    every = ()
    assert not passes()
    assert rig.order(SET_MODE, 1, 4, 3) == [0]
    assert passes()


def test_a_px4_in_flight_has_nothing_against_its_mode():
    rig = Rig("px4").hover(3.0)
    assert rig.order(SET_MODE, 1, 4, 5) == [0]
    rig.received.clear()
    assert rig.order(CHECK) == [0]
    assert rig.texts == []


def test_an_arducopter_passes_its_checks_in_whatever_mode():
    rig = Rig("ardupilot").hover(3.0)
    assert rig.order(LAND) == [0]
    rig.run(12.0)
    assert not rig.autopilot.armed
    assert rig.autopilot.mode is Mode.LAND
    assert rig.all(SysStatus)[-1].health & 0x10000000


@pytest.mark.parametrize(("streams", "beats"), [("normal", 1), ("quiet", 0)])
def test_an_arducopter_that_talks_to_people_tells_of_another_mode_at_once(streams, beats):
    rig = Rig("ardupilot", streams=streams)
    rig.run(1.5)
    rig.received.clear()
    assert rig.guided() == [0]
    assert [m.custom_mode for m in rig.all(Heartbeat)] == [4] * beats
