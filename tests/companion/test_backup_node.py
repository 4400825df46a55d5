"""The backup node sends nothing while its companion does, and the committed plan when that falls silent."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink

from companion.avoidance.certified.committed import horizon_of
from mavlink_bridge.key import Key
from mavlink_bridge.messages import SetpointLocal, Source
from mavlink_bridge.node import Datagram
from tests.companion.backup_bench import BEGIN, COMPANION, CONFIG, SYSTEM, TICK, YAW, Bench, plan_from, silent


def test_while_the_companion_speaks_it_is_silent() -> None:
    assert Bench().run(5.0) == []


def test_it_sends_the_committed_plan_to_its_end_and_some_seconds_of_hover() -> None:
    bench = silent(Bench())
    sent = bench.run(30.0)
    since = sent[0][0] - bench.now + round(30.0 * 1e6)
    assert since <= 120_000
    horizon = horizon_of(bench.plans[0])
    assert abs(sent[-1][0] - horizon.end - CONFIG.certified.backup_hover_us) <= TICK
    times = [time for time, _ in sent]
    assert set(np.diff(times)) == {CONFIG.rates.setpoint_us}
    for time, message in sent:
        motion = horizon.at(time + CONFIG.setpoint_lead_us)
        east_north_up = np.array([message.position[1], message.position[0], -message.position[2]])
        np.testing.assert_allclose(east_north_up, motion.position, atol=2e-3)
        velocity = np.array([message.velocity[1], message.velocity[0], -message.velocity[2]])
        np.testing.assert_allclose(velocity, motion.velocity, atol=1e-5)
        assert message.source == Source(SYSTEM, 191)
        assert (message.target_system, message.type_mask) == (SYSTEM, 0)
        assert message.yaw == pytest.approx(YAW, abs=1e-3)


def test_the_newest_plan_that_has_begun_is_flown() -> None:
    """Both that the companion has told: the next one from its epoch on."""
    bench = Bench()
    bench.plans = [plan_from(BEGIN + 800_000), plan_from(BEGIN + 1_200_000, 2)]
    assert bench.run(1.0) == []
    bench.speaks = False
    for time, message in bench.run(1.0):
        chosen = bench.plans[time >= BEGIN + 1_200_000]
        assert message.position[1] == pytest.approx(
            horizon_of(chosen).at(time + CONFIG.setpoint_lead_us).position[0], abs=2e-3
        )


def test_when_the_companion_is_back_it_is_silent_again() -> None:
    bench = silent(Bench())
    assert bench.run(1.0)
    bench.speaks = True
    bench.run(0.02)
    assert bench.run(3.0) == []


@pytest.mark.parametrize("how", ["another mode", "disarmed", "no heartbeat"])
def test_a_vehicle_that_somebody_else_has_is_left_alone(how: str) -> None:
    bench = silent(Bench())
    assert bench.run(0.5)
    bench.mode = mavlink.COPTER_MODE_LOITER if how == "another mode" else mavlink.COPTER_MODE_GUIDED
    bench.armed = how != "disarmed"
    bench.beats = how != "no heartbeat"
    # A heartbeat is a second old at most; without any it counts for three.
    bench.run(3.1)
    assert bench.run(2.0) == []
    # Given back, it is at nobody's plan: the old one would be somewhere else.
    bench.mode, bench.armed, bench.beats = mavlink.COPTER_MODE_GUIDED, True, True
    assert bench.run(3.0) == []


def test_what_the_companion_does_not_fly_is_not_carried_on() -> None:
    """Another clock, origin or plan: then the backup node does not know what the others rely on."""
    late, elsewhere, other = Bench(), Bench(), Bench()
    late.ahead = 1_500_000
    elsewhere.origin = np.array([0.5, 0.0, 0.0])
    for bench in (late, elsewhere):
        assert silent(bench).run(3.0) == []
    other.run(1.0)
    # The last set-point is of a plan that was never told.
    strange = SetpointLocal(COMPANION, 0, SYSTEM, 1, 1, 0, (9.0, 9.0, -5.0), (0.0,) * 3, (0.0,) * 3, YAW, 0.0)
    other.node.step(other.now, [other.tell("autopilot", strange)])
    other.speaks = False
    assert other.run(3.0) == []


def test_a_plan_of_another_time_is_none() -> None:
    bench = Bench()
    bench.plans = [plan_from(BEGIN + 60_000_000), plan_from(BEGIN - 60_000_000)]
    assert silent(bench).run(3.0) == []


@given(st.lists(st.tuples(st.sampled_from(["autopilot", "swarm"]), st.binary(max_size=300)), max_size=6))
def test_garbage_is_harmless(garbage: list[tuple[str, bytes]]) -> None:
    bench = silent(Bench())
    bench.node.step(bench.now, [Datagram(link, data) for link, data in garbage])
    assert bench.run(0.5)


KEY = Key.of_passphrase("correct horse")


def test_with_the_same_key_it_carries_on_as_without_any():
    sent = []
    for key in (None, KEY):
        bench = Bench(key, key)
        bench.run(1.0)
        bench.speaks = False
        sent.append(bench.run(1.0))
    assert sent[0] == sent[1] != []


def test_with_another_key_it_hears_nobody_and_carries_nothing_on():
    bench = Bench(KEY, None)
    bench.run(1.0)
    bench.speaks = False
    assert bench.run(2.0) == []
