"""Neighbours: whom to believe, for how long, and where their plans say that they will be."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from companion.config import CompanionConfig
from companion.obstacles.neighbours import Neighbours
from companion.values.horizon import roll_out
from mavlink_bridge.frames import FleetFrame, enu_to_ned
from mavlink_bridge.messages import GlobalPosition, Source, Tunnel
from mavlink_bridge.wire.plan import PAYLOAD_TYPE, pack, quantise
from tests.companion.rig import LAWS, ZERO, numbers, vectors

FLEET = FleetFrame(47.397742, 8.545594, 488.0)
ELSEWHERE = FleetFrame(47.5, 8.545594, 488.0)
CONFIG = CompanionConfig()
OWN, OTHER = 11, 12
NOW = 1_767_225_600_000_000
DELAY = CONFIG.neighbour.delay_us
DT, N = CONFIG.horizon.dt_us, CONFIG.horizon.steps + 1
AHEAD = 1e-6 * DT * np.arange(N)[:, None]
GRAIN = 0.02
"""m; half a step of degE7, plus what the filter makes of it."""


def position(x, v=ZERO, system=OTHER):
    latitude, longitude, altitude = FLEET.to_geodetic(x)
    ned = tuple(float(part) for part in enu_to_ned(v))
    return GlobalPosition(Source(system, 195), 0, latitude, longitude, altitude, 0.0, ned, None)


def plan(x, v=ZERO, a=None, epoch=NOW, dt=DT, system=OTHER, fleet=FLEET):
    accelerations = np.zeros((16, 3)) if a is None else a
    payload = pack(quantise(epoch, dt, x, v, accelerations, fleet.fingerprint))
    return Tunnel(Source(system, 195), 0, 0, PAYLOAD_TYPE, payload)


def hearing(*messages, now=NOW, config=CONFIG):
    """Neighbours that have heard positions (true at ``now``) and plans."""
    neighbours = Neighbours(config, OWN, FLEET)
    for message in messages:
        if isinstance(message, Tunnel):
            neighbours.receive_plan(now, message)
        else:
            neighbours.receive_position(now + config.neighbour.delay_us, message)
    return neighbours


X = np.array([10.0, -4.0, 6.0])
V = np.array([2.0, 1.0, -0.5])


def test_nobody_heard_is_nobody_there():
    obstacles = hearing().obstacles(NOW)
    assert obstacles.ids == ()
    assert obstacles.positions.shape == (0, N, 3)


def test_a_neighbour_round_the_earth_is_none():
    absurd = position(X)._replace(latitude=-47.0, longitude=-171.0)
    neighbours = hearing(absurd, absurd, plan(X, V))
    assert neighbours.obstacles(NOW).ids == ()
    neighbours.receive_position(NOW + DELAY, position(X, V))
    assert neighbours.obstacles(NOW).ids == (OTHER,)
    neighbours.receive_position(NOW + DELAY, absurd)
    np.testing.assert_allclose(neighbours.obstacles(NOW).positions[0, 0], X, atol=GRAIN)


def test_the_own_echo_is_ignored():
    neighbours = hearing(position(X, system=OWN), plan(X, system=OWN))
    assert neighbours.obstacles(NOW).ids == ()
    assert neighbours.ages(NOW) == {}
    assert neighbours.refused_plans == 0


@LAWS
@given(x=vectors(50.0), v=vectors(5.0))
def test_without_a_plan_a_neighbour_is_held_where_it_is_now(x, v):
    obstacles = hearing(position(x, v)).obstacles(NOW)
    assert obstacles.ids == (OTHER,)
    np.testing.assert_array_equal(obstacles.positions[0], np.tile(obstacles.positions[0, 0], (N, 1)))
    np.testing.assert_allclose(obstacles.positions[0, 0], x, atol=GRAIN)
    assert (obstacles.d_min, obstacles.d_safe) == (CONFIG.field.d_min, CONFIG.field.d_safe)


@LAWS
@given(x=vectors(50.0), v=vectors(5.0), later=st.integers(0, 900_000))
@example(x=X, v=V, later=500_001)
def test_without_a_plan_it_may_be_carried_on_at_constant_velocity(x, v, later):
    config = CompanionConfig(neighbour_prediction="velocity")
    obstacles = hearing(position(x, v), config=config).obstacles(NOW + later)
    np.testing.assert_allclose(
        obstacles.positions[0], x + (1e-6 * later + AHEAD) * v, atol=GRAIN + 0.01 * (1 + 1e-6 * later + 1.5)
    )


@LAWS
@given(
    x=vectors(50.0),
    v=vectors(4.0),
    a=st.lists(vectors(2.0), min_size=16, max_size=16).map(np.array),
    delay=st.integers(0, CONFIG.guard.plan_stale_us),
)
def test_a_plan_is_aligned_by_time_however_late_it_comes(x, v, a, delay):
    """Made ``delay`` ago, at n = 0 it says where the neighbour is now."""
    horizon = roll_out(NOW, DT, x, v, a)
    now = NOW + delay
    motion = horizon.at(now)
    neighbours = Neighbours(CONFIG, OWN, FLEET)
    neighbours.receive_plan(now, plan(x, v, a))
    neighbours.receive_position(now + DELAY, position(motion.position, motion.velocity))
    obstacles = neighbours.obstacles(now)
    np.testing.assert_allclose(obstacles.positions[0], horizon.positions(now, N, DT), atol=0.01)


@pytest.mark.parametrize("dt", [20_000, 80_000, 262_140])
def test_a_plan_of_other_steps_is_sampled_at_ours(dt):
    horizon = roll_out(NOW, dt, X, V, np.full((16, 3), 0.3))
    neighbours = hearing(position(X, V), plan(X, V, np.full((16, 3), 0.3), dt=dt))
    np.testing.assert_allclose(
        neighbours.obstacles(NOW).positions[0], horizon.positions(NOW, N, DT), atol=0.01
    )


def assert_held(neighbours, now=NOW):
    """The position counts, not the plan."""
    positions = neighbours.obstacles(now).positions[0]
    np.testing.assert_array_equal(positions, np.tile(positions[0], (N, 1)))


def test_an_old_plan_falls_back_to_the_position():
    neighbours = hearing(plan(X, V))
    stale = CONFIG.guard.plan_stale_us
    for late, held in ((stale, False), (stale + 1, True)):
        now = NOW + late
        neighbours.receive_position(now + DELAY, position(X + V * late * 1e-6, V))
        positions = neighbours.obstacles(now).positions[0]
        assert (np.ptp(positions, axis=0) < 1e-12).all() == held


def test_a_neighbour_that_is_not_where_it_planned_to_be_is_where_it_is():
    assert_held(hearing(position(X + np.array([1.5, 0.0, 0.0]), V), plan(X, V)))


def test_a_newer_plan_counts_whatever_arrives_last():
    new = plan(X, V, np.full((16, 3), 1.0))
    old = plan(X - V * 0.1, V, epoch=NOW - 100_000)
    expected = hearing(position(X, V), new).obstacles(NOW).positions
    for order in ((old, new), (new, old)):
        np.testing.assert_array_equal(hearing(position(X, V), *order).obstacles(NOW).positions, expected)


@pytest.mark.parametrize(
    "refused",
    [
        plan(X, V, fleet=ELSEWHERE),
        plan(X, V, epoch=NOW + DT + 4),
        plan(X, V, epoch=NOW + 3_600_000_000),
        plan(X, V, a=np.zeros((0, 3))),
        plan(X, V)._replace(payload=b""),
        plan(X, V)._replace(payload=plan(X, V).payload[:-1]),
        plan(X, V)._replace(payload=b"\x03" + plan(X, V).payload[1:]),
        plan(X, V)._replace(payload=bytes(128)),
    ],
    ids=["another frame", "from the future", "from far ahead", "empty", "nothing", "cut", "kind", "zeros"],
)
def test_a_plan_that_makes_no_sense_is_refused_and_counted(refused):
    neighbours = hearing(position(X, V), refused)
    assert neighbours.refused_plans == 1
    assert_held(neighbours)


@LAWS
@given(payload=st.binary(max_size=128))
def test_no_payload_whatever_raises_or_makes_anything_but_finite_obstacles(payload):
    neighbours = hearing(position(X, V), plan(X, V)._replace(payload=payload))
    obstacles = neighbours.obstacles(NOW)
    assert np.isfinite(obstacles.positions).all()
    assert np.linalg.norm(obstacles.positions[0, 0] - X) < 1.1


@LAWS
@given(position_bytes=st.binary(min_size=21, max_size=21), knots=st.binary(min_size=96, max_size=96))
def test_a_well_formed_plan_of_nonsense_is_not_believed(position_bytes, knots):
    """Header as it must be, contents random: either it starts where the neighbour is, or it is not used."""
    header = plan(X, V).payload[:11]
    neighbours = hearing(position(X, V), plan(X, V)._replace(payload=header + position_bytes + knots))
    obstacles = neighbours.obstacles(NOW)
    assert np.isfinite(obstacles.positions).all()
    assert np.linalg.norm(obstacles.positions[0, 0] - X) < 1.1


def test_another_payload_type_is_somebody_elses():
    neighbours = hearing(position(X, V), plan(X, V)._replace(payload_type=PAYLOAD_TYPE + 1, payload=b"x"))
    assert neighbours.refused_plans == 0
    assert_held(neighbours)


def test_a_plan_alone_is_no_neighbour():
    """Only who says where it is can be avoided; the plan counts once it does."""
    assert hearing(plan(X, V)).obstacles(NOW).ids == ()


def test_who_falls_silent_stays_an_obstacle_where_it_was_last():
    """Carried on for a bounded time: it may well still be there."""
    neighbours = hearing(position(X, V))
    bound = CONFIG.neighbour.extrapolate_us
    there = neighbours.obstacles(NOW + bound).positions[0, 0]
    np.testing.assert_allclose(there, X + 1e-6 * bound * V, atol=0.03)
    for silence in (bound + 1, 10 * bound, 1000 * bound):
        silent = neighbours.obstacles(NOW + silence)
        assert silent.ids == (OTHER,)
        np.testing.assert_allclose(silent.positions[0], np.broadcast_to(there, (16, 3)), atol=1e-6)
    assert neighbours.ages(NOW + 10 * bound)[OTHER] == 10 * bound


@LAWS
@given(v=vectors(5.0), silence=st.integers(1, 10**9), more=st.integers(1, 10**9))
def test_who_is_silent_for_too_long_rests_over_the_whole_horizon(v, silence, more):
    """Also where neighbours are carried on: what is known of a velocity does not last for ever."""
    config = CompanionConfig(neighbour_prediction="velocity")
    neighbours = hearing(position(X, v), config=config)
    bound = config.neighbour.extrapolate_us
    silent = neighbours.obstacles(NOW + bound + silence).positions[0]
    np.testing.assert_allclose(silent, np.broadcast_to(X + 1e-6 * bound * v, (N, 3)), atol=0.03)
    later = neighbours.obstacles(NOW + bound + silence + more).positions[0]
    np.testing.assert_array_equal(silent, later)
    # One that is still heard moves on beside it.
    neighbours.receive_position(NOW + bound + silence + DELAY, position(-X, V, 13))
    both = neighbours.obstacles(NOW + bound + silence).positions
    np.testing.assert_array_equal(both[0], silent)
    np.testing.assert_allclose(both[1], -X + AHEAD * V, atol=GRAIN + 0.02)


def nowhere(component=220):
    """What a receiver says that has no fix."""
    return GlobalPosition(Source(OTHER, component), 1, 0.0, 0.0, 0.0, 0.0, (0.0, 0.0, 0.0), None)


@LAWS
@given(silent=st.lists(st.booleans(), min_size=25, max_size=25), v=vectors(4.0))
def test_who_says_nothing_of_use_keeps_no_autopilots_word_out(silent, v):
    with_it, without = (Neighbours(CONFIG, OWN, FLEET) for _ in range(2))
    for k, quiet in enumerate(silent):
        now = NOW + k * 100_000
        received = position(X + 0.1 * k * v, v)._replace(source=Source(OTHER, 1))
        if not quiet:
            with_it.receive_position(now + DELAY, nowhere())
        for neighbours in (with_it, without):
            neighbours.receive_position(now + DELAY, received)
        one, other = (neighbours.obstacles(now).positions for neighbours in (with_it, without))
        np.testing.assert_array_equal(one, other)
        np.testing.assert_allclose(one[0, 0], X + 0.1 * k * v, atol=2 * GRAIN)


def test_of_a_companion_that_loses_its_fix_the_autopilot_is_heard_after_a_second():
    neighbours, off = Neighbours(CONFIG, OWN, FLEET), np.array([0.0, 1.0, 0.0])
    for k in range(100):
        now, x = NOW + k * 100_000, X + 0.1 * k * V
        neighbours.receive_position(now + DELAY, position(x, V) if k < 50 else nowhere(195))
        # Its autopilot is a metre off, by another filter.
        apart = position(x + off, V)._replace(source=Source(OTHER, 1))
        neighbours.receive_position(now + DELAY, apart)
        there = neighbours.obstacles(now).positions[0, 0]
        np.testing.assert_allclose(there, x if k < 59 else x + off, atol=0.1)


@pytest.mark.parametrize(
    ("used", "other"), [(195, 191), (195, 220), (191, 220), (220, 191), (191, 1), (195, 1)]
)
@pytest.mark.parametrize("boot", [5_000_000, 400_000_000])
def test_of_two_components_of_a_vehicle_one_alone_makes_its_track(used, other, boot):
    """Each has a clock and a filter of its own; the other one is off by three metres and speaks twice as
    often."""
    with_it, without = (Neighbours(CONFIG, OWN, FLEET) for _ in range(2))
    for k in range(60):
        now, x = NOW + k * 200_000, X + 0.2 * k * V
        mine = position(x, V)._replace(source=Source(OTHER, used), time_boot=10**7 + k * 200_000)
        apart = position(x + np.array([0.0, 3.0, 0.0]), V)
        apart = apart._replace(source=Source(OTHER, other), time_boot=boot + k * 200_000)
        for neighbours in (with_it, without):
            neighbours.receive_position(now + DELAY, mine)
        with_it.receive_position(now + DELAY, apart)
        with_it.receive_position(now + DELAY + 100_000, apart._replace(time_boot=apart.time_boot + 100_000))
        one, alone = (neighbours.obstacles(now + DELAY).positions for neighbours in (with_it, without))
        np.testing.assert_array_equal(one, alone)


def test_the_companion_of_the_fleet_comes_before_other_components():
    neighbours, off = Neighbours(CONFIG, OWN, FLEET), np.array([0.0, 3.0, 0.0])
    for k in range(40):
        now, x = NOW + k * 100_000, X + 0.1 * k * V
        neighbours.receive_position(now + DELAY, position(x + off, V)._replace(source=Source(OTHER, 191)))
        if 10 <= k < 20:
            neighbours.receive_position(now + DELAY, position(x, V)._replace(source=Source(OTHER, 195)))
        there = neighbours.obstacles(now).positions[0, 0]
        np.testing.assert_allclose(there, x if 10 <= k < 29 else x + off, atol=0.1)


@pytest.mark.parametrize("off", [-0.3, -0.1, 0.08, -5.0, 5.0])
def test_the_plans_of_a_wrong_clock_are_laid_where_their_sender_is(off):
    """Plans at 10 Hz of one at 4 m/s; a quarter of a metre is what fifty milliseconds are worth."""
    neighbours, v = Neighbours(CONFIG, OWN, FLEET), np.array([4.0, 0.0, 0.0])
    for k in range(30):
        made = NOW + k * 100_000
        x = 1e-7 * k * 1e6 * v
        neighbours.receive_plan(made + DELAY, plan(x, v, epoch=(made + round(off * 1e6)) // 4 * 4))
        neighbours.receive_position(made + DELAY, position(x, v))
    expected = x + AHEAD * v + 1e-6 * DELAY * v
    np.testing.assert_allclose(neighbours.obstacles(made + DELAY).positions[0], expected, atol=0.05)


@LAWS
@given(order=st.permutations(range(6)), v=vectors(4.0))
def test_positions_that_overtake_each_other_tell_the_same(order, v):
    """All at once, in any order: the stamps say which was when."""
    results = []
    for turn in (range(6), order):
        neighbours = Neighbours(CONFIG, OWN, FLEET)
        for k in turn:
            received = position(X + 0.1 * k * v, v)._replace(time_boot=10**7 + k * 100_000)
            # Quick ones and slow ones; the quickest took the least time that there is.
            neighbours.receive_position(NOW + 5 * 100_000 + DELAY, received)
        results.append(neighbours)
    one, other = (neighbours.obstacles(NOW + 600_000).positions for neighbours in results)
    np.testing.assert_array_equal(one, other)
    np.testing.assert_allclose(one[0, 0], X + 0.6 * v, atol=2 * GRAIN)
    assert results[0].ages(NOW + 500_000) == results[1].ages(NOW + 500_000) == {OTHER: 0}


@LAWS
@given(shift=st.integers(0, 10**12), late=st.integers(0, 600_000), speed=numbers(-3.0, 3.0))
def test_only_differences_of_time_matter(shift, late, speed):
    v = speed * V
    results = []
    for epoch in (NOW, NOW + shift):
        neighbours = Neighbours(CONFIG, OWN, FLEET)
        neighbours.receive_plan(epoch, plan(X, v, epoch=epoch))
        neighbours.receive_position(epoch + DELAY, position(X, v))
        results.append(neighbours.obstacles(epoch + late).positions)
    np.testing.assert_array_equal(results[0], results[1])


@given(without=st.sets(st.integers(OTHER, OTHER + 4)))
def test_last_states_without_some_systems_are_those_of_the_others(without):
    neighbours = hearing(*(position(X + k, V, system=OTHER + k) for k in range(4)))
    assert [one[0] for one in neighbours.last_received()] == [OTHER + k for k in range(4)]
    expected = [one for one in neighbours.last_received() if one[0] not in without]
    found = neighbours.last_received(without)
    assert [one[:2] for one in found] == [one[:2] for one in expected]
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(one[2:], other[2:])


def test_each_neighbour_keeps_its_own_plan():
    messages = [
        m for k in range(5) for m in (position(k * X, k * V, 20 + k), plan(k * X, k * V, system=20 + k))
    ]
    obstacles = hearing(*messages).obstacles(NOW)
    for k, system in enumerate(obstacles.ids):
        assert system == 20 + k
        np.testing.assert_allclose(obstacles.positions[k], k * X + AHEAD * (k * V), atol=0.01)


FLOWN_ON = 3_000_000
WARY = CONFIG.model_copy(update={"guard": CONFIG.guard.model_copy(update={"flown_on_us": FLOWN_ON})})


@LAWS
@given(vectors(3.0), st.integers(0, 20_000_000), numbers(0.0, 1.0))
def test_a_silent_neighbour_is_wherever_it_stopped_or_was_flown_on_to(v, age, share):
    stale = WARY.guard.plan_stale_us
    before, found = (hearing(position(X, v), config=config).obstacles(NOW + age) for config in (CONFIG, WARY))
    flown = 1e-6 * (stale + share * (min(max(age, stale), FLOWN_ON) - stale))
    if age <= stale:
        np.testing.assert_array_equal(found.positions, before.positions)
        assert found.d_min[0] == before.d_min[0]
        return
    # Wherever on that way it is, it is kept away from as far as if it were known to be there.
    off = np.linalg.norm(found.positions[0, 0] - (X + flown * v))
    assert off + before.d_min[0] <= found.d_min[0] + 2 * GRAIN + 0.05 * np.linalg.norm(v)
    assert found.d_safe[0] - found.d_min[0] == pytest.approx(before.d_safe[0] - before.d_min[0])


@LAWS
@given(
    v=vectors(3.0),
    a=vectors(5.0),
    age=st.integers(600_000, 20_000_000),
    share=numbers(0.0, 1.0),
    thrust=numbers(0.0, 1.0),
    quicker=st.integers(0, DELAY // 4),
)
def test_a_silent_neighbour_may_have_been_driven_on_as_it_meant_to_accelerate(
    v, a, age, share, thrust, quicker
):
    """By the acceleration of its last set-point for a second at most, and at any time it may have stopped.
    Where the link is quicker than messages are taken to be, the plan begins after the state it came with."""
    stale = 1e-6 * WARY.guard.plan_stale_us
    told = position(X, v), plan(X, v, np.tile(a, (16, 1)), epoch=NOW + 4 * quicker)
    before, found = (hearing(*told, config=config).obstacles(NOW + age) for config in (CONFIG, WARY))
    flown = stale + share * (1e-6 * min(age, FLOWN_ON) - stale)
    burn = min(thrust, flown)
    there = X + flown * v + burn * (flown - 0.5 * burn) * a
    off = np.linalg.norm(found.positions[0, 0] - there)
    # Who stops early has left the straight way between by an eighth of what it means to do, at most.
    spare = 2 * GRAIN + 0.05 * np.linalg.norm(v) + np.linalg.norm(a) / 8 + 0.05
    assert off + before.d_min[0] <= found.d_min[0] + spare


@LAWS
@given(
    v=vectors(4.0),
    delay=st.integers(550_000, 60_000_000),
    later=st.integers(0, 400_000),
    wary=st.booleans(),
    share=numbers(0.0, 1.0),
)
def test_what_came_lately_is_held_where_it_says_however_old_it_is_dated(v, delay, later, wary, share):
    """Its sender may have begun anew; and wherever it has been carried to since, as it may be a delay."""
    config = WARY if wary else CONFIG
    came = NOW + 100_000 + delay
    neighbours = hearing(position(X, v)._replace(time_boot=10**7), config=config)
    told = position(X + 0.1 * v, v)._replace(time_boot=10**7 + 100_000)
    neighbours.receive_position(came + DELAY, told)
    found = neighbours.obstacles(came + later)
    assert neighbours.ages(came)[OTHER] == pytest.approx(delay, abs=20_000)
    carried = 1e-6 * min(delay, FLOWN_ON if wary else config.neighbour.extrapolate_us)
    for there in (X + 0.1 * v, X + (0.1 + share * carried) * v):
        off = np.linalg.norm(found.positions[0, 0] - there)
        assert off + config.field.d_min <= found.d_min[0] + 2 * GRAIN + 0.05 * np.linalg.norm(v)
    # Which a fresh plan of the same place puts right.
    neighbours.receive_plan(came + later, plan(X + 0.1 * v, v, epoch=came + 4 * (later // 4)))
    found = neighbours.obstacles(came + later)
    assert found.d_min == [config.field.d_min]
    np.testing.assert_allclose(found.positions[0], X + 0.1 * v + AHEAD * v, atol=0.01)


def test_a_mate_of_a_perception_formation_outlasts_some_lost_messages():
    later = NOW + CONFIG.guard.plan_stale_us + 100_000
    for kind, kept in (("perception", (OTHER,)), ("spread", ())):
        config = CompanionConfig.model_validate({"formation": {"kind": kind}})
        neighbours = hearing(position(X, V), plan(X, V), config=config)
        assert neighbours.mates(NOW).ids == (OTHER,)
        assert neighbours.mates(later).ids == kept
        assert neighbours.mates(NOW + 4_900_000).ids == kept
        assert neighbours.mates(NOW + 6_000_000).ids == ()


def test_with_committed_plans_a_mate_is_who_reports_its_position():
    config = CompanionConfig.model_validate({"formation": {"kind": "perception"}, "avoidance": "certified"})
    autopilot = position(X, V, system=13)._replace(source=Source(13, 1))
    neighbours = hearing(position(X, V), autopilot, config=config)
    assert neighbours.mates(NOW).ids == (OTHER,)
    assert neighbours.mates(NOW + 6_000_000).ids == ()
