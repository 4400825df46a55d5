"""Out of earshot: nobody is ignored who could have acted on a plan, and nobody comes near unheard."""

from __future__ import annotations

from math import hypot

import numpy as np
import pytest
from companion_rig import LAWS, QUICK, ZERO, numbers, vectors
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.config import CompanionConfig, FieldConfig, GuardConfig, MovingSphere, RatesConfig
from companion.horizon import roll_out
from companion.planner import Planner, standing
from companion.reception import accepts
from companion.sharing import plan_message, position_message
from companion.tracks import State
from companion.world import World
from mavlink_bridge.codec import Codec
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import Source

FLEET = FleetFrame(47.397742, 8.545594, 488.0)
NOW = 1_767_225_600_000_000
OWN, OTHER = 11, 12
PERIOD = 100_000
CONFIG = CompanionConfig(methods=("tangential", "approach_angle"))
FASTEST = hypot(*CONFIG.limits.v_max)
STEPS, DT = CONFIG.horizon.steps + 1, 1e-6 * CONFIG.horizon.dt_us
AHEAD = DT * np.arange(STEPS)[:, None]
BALL = MovingSphere(kind="sphere", system=OTHER, radius=5.0)
FAR = 200.0
CERTAINLY = 60.0
"""m: nearer than this nobody is ignored, whatever it does."""
CONFIGS = st.sampled_from(
    [
        CONFIG,
        CompanionConfig(methods=("tangential",), field=FieldConfig(braking=None)),
        CompanionConfig(methods=("tangential",), field=FieldConfig(position_sigma=0.5)),
        CompanionConfig(guard=GuardConfig(flown_on_us=3_000_000)),
        CompanionConfig(rates=RatesConfig(state_us=200_000)),
    ]
)
UNIT = vectors(1.0).filter(lambda v: float(v @ v) > 0.01).map(lambda v: v / np.linalg.norm(v))


def told(system, place, velocity, now, *, plan=True):
    """What the vehicle says at ``now``: where it is, and that it goes straight on."""
    source = Source(system, 195)
    messages = [position_message(source, now - NOW + PERIOD, FLEET, place, velocity, None)]
    if plan:
        horizon = roll_out(now, CONFIG.horizon.dt_us, place, velocity, np.zeros((STEPS, 3)))
        messages.append(plan_message(horizon, source, FLEET))
    return messages


class Listener:
    """A world behind its header filter, on a clean link; it looks around ten times a second."""

    def __init__(self, config=CONFIG):
        self.world = World(config, OWN, 1, FLEET)
        self.earshot = self.world.neighbours.earshot
        self.codec = Codec(accepts("swarm", OWN, 1, config, self.earshot.ignores))
        self._speakers = Codec()
        self._delay = config.neighbour.delay_us

    def hear(self, now, *messages):
        self.earshot.now = now + self._delay
        for message in messages:
            for heard in self.codec.feed(self._speakers.encode(message)):
                self.world.hear(now + self._delay, "swarm", heard)

    def look(self, now, place=ZERO, velocity=ZERO):
        self.earshot.now = now
        self.world.neighbours.listen(now, State(place, velocity, 0))

    def decoded(self):
        return self.codec.counters.good


def after_seconds(place, velocity, config=CONFIG, seconds=1, *, plan=True, own=ZERO):
    """Who has heard one neighbour at ``place`` for a while, and looked around since."""
    listener = Listener(config)
    for k in range(10 * seconds):
        listener.hear(NOW + k * PERIOD, *told(OTHER, place, velocity, NOW + k * PERIOD, plan=plan))
    listener.look(NOW + 10 * seconds * PERIOD, velocity=own)
    return listener


@QUICK
@given(config=CONFIGS, direction=UNIT, distance=numbers(CERTAINLY, FAR), speed=numbers(0.0, 1.0))
def test_who_is_ignored_can_act_on_no_plan_until_it_is_heard_again(config, direction, distance, speed):
    """Not even if both make for each other as fast as they may from the moment that it was last heard."""
    place, velocity = distance * direction, -speed * FASTEST * direction
    # Two seconds for the filter to have settled on the speed.
    listener = after_seconds(place, velocity, config)
    start = NOW + 10 * PERIOD
    until = listener.earshot._until.get(OTHER, start)
    if until == start:
        return
    assert until - start < 1_000_000
    last = until + 2 * config.rates.state_us
    since = 1e-6 * (last - start)
    own = FASTEST * since * direction
    other = place - FASTEST * (since + 1e-6 * (PERIOD + config.neighbour.delay_us)) * direction
    # As full hearing would have it at the last moment before it is heard.
    attentive = Listener(config)
    for k in range(10):
        told_at = last - (10 - k) * PERIOD
        way = 1e-6 * (last - told_at) * FASTEST * direction
        attentive.hear(told_at, *told(OTHER, other + way, -FASTEST * direction, told_at))
    prediction = own + AHEAD * FASTEST * direction
    obstacles = attentive.world.neighbours.obstacles(last)
    aim = standing(own + 100.0 * direction)
    free, seen = Planner(config), Planner(config)
    one = free.plan(last, own, FASTEST * direction, prediction, aim, obstacles._replace(ids=()))
    two = seen.plan(last, own, FASTEST * direction, prediction, aim, obstacles)
    np.testing.assert_array_equal(two.force, one.force)
    np.testing.assert_array_equal(two.horizon.knots, one.horizon.knots)


@LAWS
@given(direction=UNIT, distance=numbers(0.0, FAR), ours=vectors(5.0), theirs=vectors(5.0))
def test_who_is_not_laid_before_the_planner_would_not_have_mattered(direction, distance, ours, theirs):
    place = distance * direction
    world = after_seconds(place, theirs, own=ours).world
    now = NOW + 10 * PERIOD
    every, some = world.neighbours.obstacles(now), world.neighbours.obstacles(now, ZERO)
    assert every.ids == (OTHER,)
    assert set(some.ids) <= {OTHER}
    plans = [
        Planner(CONFIG).plan(now, ZERO, ours, AHEAD * ours, standing(place), obstacles)
        for obstacles in (every, some)
    ]
    np.testing.assert_array_equal(plans[0].horizon.knots, plans[1].horizon.knots)
    assert some.ids == every.ids or distance > CERTAINLY


@settings(deadline=None, max_examples=6)
@given(direction=UNIT, speed=numbers(0.4, 1.0))
def test_nobody_comes_near_unheard(direction, speed):
    listener, silences, last = Listener(), [0], NOW
    place, velocity = FAR * direction, -speed * FASTEST * direction
    now = NOW
    while float(np.linalg.norm(place)) > CERTAINLY and now < NOW + 45_000_000:
        before = listener.decoded()
        listener.hear(now, *told(OTHER, place, velocity, now))
        heard = listener.decoded() > before
        silences.append(now - last)
        last = now if heard else last
        listener.look(now + PERIOD // 2)
        ages = listener.world.neighbours.ages(now + PERIOD)
        assert ages[OTHER] < CONFIG.guard.neighbour_lost_us // 2
        known = listener.world.neighbours.last_heard()[0]
        np.testing.assert_allclose(known[2] + 1e-6 * (now - known[1]) * known[3], place, atol=2.0)
        now += PERIOD
        place = place + 1e-6 * PERIOD * velocity
    for k in range(5):
        before = listener.decoded()
        listener.hear(now + k * PERIOD, *told(OTHER, place, velocity, now + k * PERIOD))
        listener.look(now + k * PERIOD + PERIOD // 2)
        assert k == 0 or listener.decoded() == before + 2
    assert max(silences) < 1_000_000


@pytest.mark.parametrize(
    ("who", "config", "changes"),
    [
        ("a stranger that shares no plan", CONFIG, {"plan": False}),
        ("who is faster than the limits", CONFIG, {"velocity": np.array([0.0, 12.0, 0.0])}),
        ("what is no vehicle", CONFIG.model_copy(update={"moving": (BALL,)}), {}),
        ("anybody, who is too fast itself", CONFIG, {"own": np.array([0.0, 12.0, 0.0])}),
        ("anybody, with certified plans", CONFIG.model_copy(update={"avoidance": "certified"}), {}),
    ],
)
def test_always_heard_is(who, config, changes):
    arguments = {"velocity": ZERO, **changes}
    place = np.array([FAR, 0.0, 0.0])
    listener = after_seconds(place, arguments.pop("velocity"), config, **arguments)
    assert not listener.earshot.ignores(OTHER), who


def test_a_familiar_one_far_away_is_ignored_and_the_own_place_has_to_be_known():
    listener = after_seconds(np.array([FAR, 0.0, 0.0]), ZERO)
    assert listener.earshot.ignores(OTHER)
    assert not listener.earshot.ignores(OTHER + 1)
    now = NOW + 10 * PERIOD
    listener.world.neighbours.listen(now, None)
    assert not listener.earshot.ignores(OTHER)
    listener.world.neighbours.listen(now, State(ZERO, ZERO, CONFIG.guard.own_stale_us + 1))
    assert not listener.earshot.ignores(OTHER)


def test_ignoring_ends_by_itself():
    """A companion that hangs looks around no more."""
    listener = after_seconds(np.array([FAR, 0.0, 0.0]), ZERO)
    listener.earshot.now += 1_000_000
    assert not listener.earshot.ignores(OTHER)


@pytest.mark.parametrize("far", [0, 8, 40])
def test_those_out_of_range_are_hardly_decoded_and_cost_the_planner_nothing(far):
    """One is near, the others are anywhere far off: what is done for each of them does not grow with their
    number, and for the plan they are not there."""
    listener = Listener()
    seconds, places = 5, {OTHER: np.array([6.0, 0.0, 0.0])}
    for k in range(far):
        places[20 + k] = 150.0 * np.array([np.cos(k), np.sin(k), 0.0])
    for tick in range(10 * seconds):
        now = NOW + tick * PERIOD
        for system, place in places.items():
            listener.hear(now, *told(system, place, ZERO, now))
        listener.look(now + PERIOD // 2)
    sent = 2 * 10 * seconds
    near = sent
    assert listener.decoded() - near <= 0.2 * sent * far
    assert listener.decoded() >= near + (2 * seconds * far if far else 0)
    assert listener.world.neighbours.obstacles(NOW + seconds * 1_000_000, ZERO).ids == (OTHER,)
    assert set(listener.world.neighbours.ages(NOW)) == set(places)
