"""With the additions the vehicle is where the plan says: by models of the loops, written down here."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from companion.flight.autopilots import Inverse, Loop, Shaping
from companion.flight.autopilots.ardupilot import ARDUPILOT
from companion.flight.autopilots.px4 import PX4
from companion.flight.plan_feedforward import MAX_OFFSET_M, PlanFeedforward
from companion.values.horizon import Array, Motion, roll_out

STEP_US = 20_000
FINE = 20
"""Steps of the models in one of the set-points."""
BEGIN = 1_000_000
gains = st.tuples(st.floats(0.7, 1.5), st.floats(1.5, 3.0), st.floats(0.3, 1.5))
drags = st.floats(0.0, 0.5)
seeds = st.integers(0, 2**32 - 1)


def plan_of(seed: int) -> Callable[[int], Motion]:
    """A plan that begins and ends at rest, with a change of acceleration of 0.7 m/s² at most."""
    rng = np.random.default_rng(seed)
    changes = rng.uniform(-0.7, 0.7, (12, 3))
    up = np.cumsum(changes, axis=0)
    accelerations = np.concatenate([np.zeros((5, 3)), up, -up, np.zeros((80, 3))])
    horizon = roll_out(BEGIN, 200_000, np.zeros(3), np.zeros(3), accelerations)
    return horizon.at


def followed(
    loop: Loop, drag: float, plan: Callable[[int], Motion], *, helped: bool, lag_us: int = 0
) -> float:
    """Largest distance (m) of a vehicle with this ``drag`` from its ``plan``, on the first axis.

    The vehicle follows an own trajectory, which approaches the set-points with the gains 2 g and g, with a
    proportional and integral velocity loop, and gets its acceleration ``lag_us`` later.
    """
    assert loop.inverse is not None
    assert loop.shaping is not None
    g, dt = loop.shaping.position, 1e-6 * STEP_US / FINE
    feedforward = PlanFeedforward()
    x = v = own_x = own_v = total = worst = 0.0
    waiting = [0.0] * max(round(lag_us / (1e6 * dt)), 0)
    for now in range(BEGIN, BEGIN + 12_000_000, STEP_US):
        added = feedforward.step(now, plan, loop, drag)
        for part in range(FINE):
            time = now + part * STEP_US // FINE
            place, speed, change = (float(one[0]) for one in plan(time))
            if helped:
                speed += float(added.velocity[0]) + 1e-6 * (time - now) * float(added.acceleration[0])
                change += float(added.acceleration[0])
            own_a = change + 2.0 * g * (g * (place - own_x) + speed - own_v)
            error = own_v - v + loop.position * (own_x - x)
            total += dt * error
            waiting.append(own_a + loop.velocity * error + loop.inverse.integral * total)
            a = waiting.pop(0) - drag * v
            x, v = x + dt * (v + 0.5 * dt * a), v + dt * a
            own_x, own_v = own_x + dt * (own_v + 0.5 * dt * own_a), own_v + dt * own_a
        worst = max(worst, abs(x - float(plan(now + STEP_US).position[0])))
    return worst


def largest_offset(loop: Loop, drag: float, plan: Callable[[int], Motion]) -> float:
    """Largest offset (m) on an axis during the ``plan``."""
    feedforward = PlanFeedforward()
    times = range(BEGIN, BEGIN + 12_000_000, STEP_US)
    return max(float(np.abs(feedforward.step(now, plan, loop, drag).offset).max()) for now in times)


def loop_of(numbers: tuple[float, float, float], lag_us: int) -> Loop:
    position, velocity, integral = numbers
    shaping = Shaping(jerk=5.0, position=1.0, velocity=2.0)
    return Loop(position, velocity, 1.0, shaping, inverse=Inverse(integral, lag_us))


@pytest.mark.slow
@given(seeds, gains, drags)
def test_a_vehicle_with_known_drag_and_without_lag_is_on_its_plan(
    seed: int, numbers: tuple[float, float, float], drag: float
) -> None:
    """But for what comes of set-points that are 20 ms apart, unless the offset reaches its bound."""
    plan, loop = plan_of(seed), loop_of(numbers, 0)
    assume(largest_offset(loop, drag, plan) < MAX_OFFSET_M)
    without = followed(loop, drag, plan, helped=False)
    assert followed(loop, drag, plan, helped=True) <= 0.01 + 0.05 * without


@pytest.mark.slow
@given(seeds, gains, st.floats(0.1, 0.5))
def test_a_lag_of_the_attitude_costs_a_fraction_of_what_it_did(
    seed: int, numbers: tuple[float, float, float], drag: float
) -> None:
    """The lag acts on the loop's own corrections, too, which the additions do not cover."""
    plan = plan_of(seed)
    without = followed(loop_of(numbers, 0), drag, plan, helped=False, lag_us=180_000)
    assert followed(loop_of(numbers, 180_000), drag, plan, helped=True, lag_us=180_000) < 0.6 * without


def test_nothing_is_added_at_rest_and_at_a_constant_speed_in_the_end() -> None:
    feedforward, loop = PlanFeedforward(), ARDUPILOT.loop

    def cruise(time: int) -> Motion:
        speed = np.array([3.0, -1.0, 0.5])
        return Motion(1e-6 * time * speed, speed, np.zeros(3))

    for time in range(0, 40_000_000, STEP_US):
        added = feedforward.step(time, cruise, loop, 0.3)
    for one in added:
        np.testing.assert_allclose(one, 0.0, atol=1e-3)
    still = Motion(np.ones(3), np.zeros(3), np.zeros(3))
    added = PlanFeedforward().step(0, lambda _: still, loop, 0.3)
    assert not any(one.any() for one in added)


@settings(max_examples=25)
@given(seeds, st.floats(-3.2, 3.2))
def test_it_turns_with_the_plan_and_leaves_the_height(seed: int, angle: float) -> None:
    c, s = np.cos(angle), np.sin(angle)
    turn: Array = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    plan = plan_of(seed)
    one, two = PlanFeedforward(), PlanFeedforward()
    for time in range(BEGIN, BEGIN + 5_000_000, STEP_US):
        first = one.step(time, plan, ARDUPILOT.loop, 0.3)
        second = two.step(time, lambda at: Motion(*(turn @ part for part in plan(at))), ARDUPILOT.loop, 0.3)
        if np.abs(first.offset).max() > 0.3:
            # Near its bound, which is one of each axis.
            return
        np.testing.assert_allclose(second.velocity, turn @ first.velocity, atol=1e-9)
        np.testing.assert_allclose(second.acceleration, turn @ first.acceleration, atol=1e-9)
        assert first.velocity[2] == first.acceleration[2] == 0.0


def test_after_a_pause_the_offset_begins_anew() -> None:
    plan, feedforward = plan_of(3), PlanFeedforward()
    for time in range(BEGIN, BEGIN + 3_000_000, STEP_US):
        added = feedforward.step(time, plan, ARDUPILOT.loop, 0.4)
    assert added.offset.any()
    assert not feedforward.step(time + 600_000, plan, ARDUPILOT.loop, 0.4).offset.any()


def test_the_derivative_of_a_px4_is_made_up_for_when_it_acts() -> None:
    plan, loop = plan_of(5), PX4.loop
    time = BEGIN + 2_000_000
    added = PlanFeedforward().step(time, plan, loop, 0.3)
    later = plan(time + loop.lead_us).acceleration
    np.testing.assert_allclose(added.acceleration, [*(0.2 * later[:2]), 0.0])
    assert not added.velocity.any()
