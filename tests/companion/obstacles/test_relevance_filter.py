"""Out of earshot: nobody is ignored who could have acted on a plan, and nobody comes near unheard."""

from __future__ import annotations

from math import hypot

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.avoidance.field.planner import Planner, standing
from companion.config.companion import CompanionConfig, MovingSphere
from companion.config.flight import GuardConfig, RatesConfig
from companion.config.formation import Perception
from companion.config.planning import ApproachAngleConfig, FieldConfig
from companion.config.target_source import FusedSource
from companion.estimation.tracks import State
from companion.goals.settling import Settling
from companion.telemetry.reception import accepts
from companion.telemetry.sharing import plan_message, position_message
from companion.values.horizon import Motion, roll_out
from companion.world import World
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import Source
from mavlink_bridge.wire.codec import Codec
from tests.companion.rig import LAWS, QUICK, ZERO, numbers, vectors

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
SECONDS = 4
"""Longer than one has to be known before it may be ignored."""
SLOW = CompanionConfig(
    methods=("approach_angle",),
    approach_angle=ApproachAngleConfig(reach=30.0),
    limits=CONFIG.limits.model_copy(update={"v_max": (0.5, 0.5, 0.5)}),
)
"""The angles reach further than the field of who is slow."""
CONFIGS = st.sampled_from(
    [
        CONFIG,
        SLOW,
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
        self.relevance = self.world.neighbours.relevance
        self.codec = Codec(accepts("swarm", OWN, 1, config, self.world.neighbours.ignores))
        self._speakers = Codec()
        self._delay = config.neighbour.delay_us
        self.heard_at = NOW

    def receive(self, now, *messages):
        self.relevance.now = now + self._delay
        for message in messages:
            for received in self.codec.feed(self._speakers.encode(message)):
                self.heard_at = now
                self.world.receive(now + self._delay, "swarm", received)

    def look(self, now, place=ZERO, velocity=ZERO):
        self.relevance.now = now
        self.world.neighbours.listen(now, State(place, velocity, 0))

    def decoded(self):
        return self.codec.counters.good


END = NOW + 10 * SECONDS * PERIOD


def after_seconds(place, velocity, config=CONFIG, *, plan=True, own=ZERO):
    """Who has heard one neighbour for a while, which is at ``place`` at the end, and looked around since."""
    listener = Listener(config)
    for now in range(NOW, END, PERIOD):
        there = place + 1e-6 * (now - END) * velocity
        listener.receive(now, *told(OTHER, there, velocity, now, plan=plan))
        listener.look(now + PERIOD // 2, velocity=own)
    listener.look(END, velocity=own)
    return listener


def test_of_whom_its_autopilot_tells_nobody_else_becomes_the_voice_unheard():
    """A receiver without a fix beside it, far off: the autopilot's next word is heard and counts."""
    listener = Listener()
    place, nothing = FAR * np.array([1.0, 0.0, 0.0]), Source(OTHER, 220)
    for now in range(NOW, END + 20 * PERIOD, PERIOD):
        state, plan = told(OTHER, place, ZERO, now)
        lost = state._replace(source=nothing, latitude=0.0, longitude=0.0)
        listener.receive(now, lost, state._replace(source=Source(OTHER, 1)), plan)
        listener.look(now + PERIOD // 2)
        age = listener.world.neighbours.ages(now)[OTHER]
        assert age <= listener.relevance._max_age_s * 1e6 + PERIOD
    assert listener.decoded() < 3 * (END + 20 * PERIOD - NOW) // PERIOD


def planned(config, now, position, velocity, prediction, aim, obstacles):
    """The second of two plans: methods weigh by the first one's gradient."""
    planner = Planner(config)
    planner.plan(now - PERIOD, position, velocity, prediction, aim, obstacles)
    return planner.plan(now, position, velocity, prediction, aim, obstacles)


@QUICK
@given(config=CONFIGS, direction=UNIT, beyond=numbers(-2.0, 100.0), speed=numbers(0.0, 1.0))
def test_who_is_ignored_can_act_on_no_plan_until_it_is_heard_again(config, direction, beyond, speed):
    """Not even if both make for each other as fast as they may from the moment that it was last heard."""
    fastest = hypot(*config.limits.v_max)
    place = (Listener(config).relevance._relevant_distance + beyond) * direction
    velocity = -speed * fastest * direction
    listener = after_seconds(place, velocity, config)
    until = listener.relevance._ignored_until.get(OTHER, END)
    if until == END:
        return
    assert until - END < 1_000_000
    last = until + 2 * config.rates.state_us
    own = fastest * 1e-6 * (last - END) * direction
    received, silent = listener.heard_at, 1e-6 * (last - listener.heard_at)
    other = place + 1e-6 * (received - END) * velocity - fastest * silent * direction
    # As full hearing would have it at the last moment before it is heard.
    attentive = Listener(config)
    for told_at in range(last - 10 * PERIOD, last, PERIOD):
        way = 1e-6 * (last - told_at) * fastest * direction
        attentive.receive(told_at, *told(OTHER, other + way, -fastest * direction, told_at))
    prediction = own + AHEAD * fastest * direction
    obstacles = attentive.world.neighbours.obstacles(last)
    aim = standing(own + 100.0 * direction, ZERO)
    one, two = (
        planned(config, last, own, fastest * direction, prediction, aim, these)
        for these in (obstacles._replace(ids=()), obstacles)
    )
    np.testing.assert_array_equal(two.force, one.force)
    np.testing.assert_array_equal(two.horizon.knots, one.horizon.knots)


@LAWS
@given(direction=UNIT, distance=numbers(0.0, FAR), ours=vectors(5.0), theirs=vectors(5.0))
def test_who_is_not_laid_before_the_planner_would_not_have_mattered(direction, distance, ours, theirs):
    place = distance * direction
    world = after_seconds(place, theirs, own=ours).world
    every, some = world.neighbours.obstacles(END), world.neighbours.obstacles(END, ZERO[None])
    assert every.ids == (OTHER,)
    assert set(some.ids) <= {OTHER}
    plans = [
        planned(CONFIG, END, ZERO, ours, AHEAD * ours, standing(place, -place), obstacles)
        for obstacles in (every, some)
    ]
    np.testing.assert_array_equal(plans[0].horizon.knots, plans[1].horizon.knots)
    assert some.ids == every.ids or distance > CERTAINLY


def test_the_angles_act_at_the_edge_of_what_is_laid_before_the_planner():
    """The laws above would hold of methods that do nothing."""
    reach = SLOW.approach_angle.reach
    place = np.array([reach - 2.0, 1.0, 0.0])
    obstacles = after_seconds(place, ZERO, SLOW).world.neighbours.obstacles(END, ZERO[None])
    ours, aim = np.array([0.5, 0.0, 0.0]), standing(np.array([60.0, 0.0, 0.0]), np.array([60.0, 5.0, 0.0]))
    acted = planned(SLOW, END, ZERO, ours, AHEAD * ours, aim, obstacles)
    assert np.abs(acted.force).max() > 0.0


def test_who_is_straight_below_is_landed_on_from_no_height():
    """However high: settling looks at the plane alone."""
    below = np.array([0.3, 0.0, -150.0])
    world = after_seconds(below, ZERO).world
    obstacles = world.neighbours.obstacles(END, ZERO[None])
    assert obstacles.ids == (OTHER,)
    settling = Settling(CONFIG)
    settling.rest(0, Motion(ZERO, ZERO, ZERO), obstacles)
    assert not settling.clear
    aside = np.array([30.0, 0.0, -150.0])
    obstacles = after_seconds(aside, ZERO).world.neighbours.obstacles(END, ZERO[None])
    assert obstacles.ids == ()


@pytest.mark.parametrize(("speed", "waits"), [(3.0, True), (0.0, False)])
def test_one_that_passes_is_waited_for_and_one_that_stays_is_left(speed, waits):
    """For five seconds; the place to land is the own one, if it can be."""
    place, velocity = np.array([0.3, 0.0, -5.0]), np.array([speed, 0.0, 0.0])
    obstacles = after_seconds(place, velocity).world.neighbours.obstacles(END, ZERO[None])
    settling, here = Settling(CONFIG), Motion(ZERO, ZERO, ZERO)
    stays = [np.array_equal(settling.rest(k * 1_000_000, here, obstacles), ZERO) for k in range(7)]
    assert stays == [waits] * 5 + [False] * 2
    assert not settling.clear


def test_a_place_that_the_plan_does_not_begin_at_counts_too():
    """After a jump of the own place a plan begins where the vehicle is measured to be."""
    place = np.array([FAR, 0.0, 0.0])
    neighbours = after_seconds(place, ZERO).world.neighbours
    assert neighbours.obstacles(END, np.stack([ZERO, place + 5.0])).ids == (OTHER,)


def test_two_things_said_of_where_one_is_make_nobody_deaf():
    """A receiver that jumps for two messages, or somebody who speaks in another's name."""
    near, far = np.array([5.0, 0.0, 0.0]), np.array([150.0, 0.0, 0.0])
    listener = Listener()
    for k, now in enumerate(range(NOW, NOW + 12_000_000, PERIOD)):
        place = far if k in (45, 46, 60, 61, 68, 69) else near
        before = listener.decoded()
        # Whoever speaks in its name has no plan of it.
        listener.receive(now, *told(OTHER, place, ZERO, now, plan=place is near))
        assert listener.decoded() > before, k
        listener.look(now + PERIOD // 2)


def test_who_is_not_where_its_plan_is_is_heard():
    listener = Listener()
    place, plan = np.array([FAR, 0.0, 0.0]), np.array([FAR - 3.0, 0.0, 0.0])
    for now in range(NOW, END, PERIOD):
        listener.receive(now, told(OTHER, place, ZERO, now)[0], told(OTHER, plan, ZERO, now)[1])
        listener.look(now + PERIOD // 2)
        assert not listener.relevance.ignores(OTHER)


@pytest.mark.parametrize("loss", [0.1, 0.3])
def test_an_ignored_companion_goes_on_being_its_vehicles_voice(loss):
    """Its autopilot says the same by another clock; if that were believed in between, the track would begin
    anew each time."""
    config = CompanionConfig(rates=RatesConfig(state_us=200_000))
    random, place = np.random.default_rng(1), np.array([150.0, 0.0, 0.0])
    listener, tracks = Listener(config), set()
    for now in range(NOW, NOW + 60_000_000, PERIOD):
        by_autopilot = position_message(Source(OTHER, 1), now - NOW + 77, FLEET, place, ZERO, None)
        said = [by_autopilot, *(told(OTHER, place, ZERO, now) if now // PERIOD % 2 else [])]
        listener.receive(now, *(message for message in said if random.random() > loss))
        listener.look(now + PERIOD // 2)
        if now > NOW + 2_000_000:
            tracks.add(listener.world.neighbours._tracks._senders[OTHER].track)
    assert len(tracks) == 1
    assert listener.decoded() < 600


@settings(deadline=None, max_examples=6)
@given(direction=UNIT, speed=numbers(0.4, 1.0))
def test_nobody_comes_near_unheard(direction, speed):
    listener, silences, last = Listener(), [0], NOW
    place, velocity = FAR * direction, -speed * FASTEST * direction
    now = NOW
    while float(np.linalg.norm(place)) > CERTAINLY and now < NOW + 45_000_000:
        before = listener.decoded()
        listener.receive(now, *told(OTHER, place, velocity, now))
        received = listener.decoded() > before
        silences.append(now - last)
        last = now if received else last
        listener.look(now + PERIOD // 2)
        ages = listener.world.neighbours.ages(now + PERIOD)
        assert ages[OTHER] < CONFIG.guard.neighbour_lost_us // 2
        known = listener.world.neighbours.last_received()[0]
        np.testing.assert_allclose(known[2] + 1e-6 * (now - known[1]) * known[3], place, atol=2.0)
        now += PERIOD
        place = place + 1e-6 * PERIOD * velocity
    for k in range(5):
        before = listener.decoded()
        listener.receive(now + k * PERIOD, *told(OTHER, place, velocity, now + k * PERIOD))
        listener.look(now + k * PERIOD + PERIOD // 2)
        assert k == 0 or listener.decoded() == before + 2
    assert max(silences) < 1_000_000


SEEING = {"formation": Perception(kind="perception"), "target_source": FusedSource(kind="fused")}


@pytest.mark.parametrize(
    ("who", "config", "changes"),
    [
        ("a stranger that shares no plan", CONFIG, {"plan": False}),
        ("who is faster than the limits", CONFIG, {"velocity": np.array([0.0, 12.0, 0.0])}),
        ("what is no vehicle", CONFIG.model_copy(update={"moving": (BALL,)}), {}),
        ("anybody, who is too fast itself", CONFIG, {"own": np.array([0.0, 12.0, 0.0])}),
        ("anybody, with certified plans", CONFIG.model_copy(update={"avoidance": "certified"}), {}),
        ("anybody, by the swivel", CONFIG.model_copy(update={"methods": ("swivel",)}), {}),
        ("anybody whose camera counts", CONFIG.model_copy(update=SEEING), {}),
    ],
)
def test_always_heard_is(who, config, changes):
    arguments = {"velocity": ZERO, **changes}
    place = np.array([FAR, 0.0, 0.0])
    listener = after_seconds(place, arguments.pop("velocity"), config, **arguments)
    assert not listener.relevance.ignores(OTHER), who


def test_methods_may_change_in_flight():
    listener = after_seconds(np.array([FAR, 0.0, 0.0]), ZERO)
    assert listener.relevance.ignores(OTHER)
    listener.relevance.use(("tangential", "swivel"))
    assert not listener.relevance.ignores(OTHER)
    assert listener.world.neighbours.obstacles(END, ZERO[None]).ids == (OTHER,)
    listener.look(END)
    assert not listener.relevance.ignores(OTHER)
    listener.relevance.use(("tangential",))
    listener.look(END)
    assert listener.relevance.ignores(OTHER)


def test_a_familiar_one_far_away_is_ignored_and_the_own_place_has_to_be_known():
    listener = after_seconds(np.array([FAR, 0.0, 0.0]), ZERO)
    assert listener.relevance.ignores(OTHER)
    assert not listener.relevance.ignores(OTHER + 1)
    listener.world.neighbours.listen(END, None)
    assert not listener.relevance.ignores(OTHER)
    listener.world.neighbours.listen(END, State(ZERO, ZERO, CONFIG.guard.own_stale_us + 1))
    assert not listener.relevance.ignores(OTHER)


THING, BESIDE, TWO_STORIES, OLD_PLAN, NO_PLAN = range(21, 26)
FAMILIAR = {31, 32}
WITH_A_THING = CONFIG.model_copy(update={"moving": (BALL.model_copy(update={"system": THING}),)})


def strange(system, place, now):
    """What each of a mixed crowd says; all hover."""
    where, plan = told(system, place, ZERO, now)
    if system == BESIDE:
        plan = told(system, place + np.array([2.0, 0.0, 0.0]), ZERO, now)[1]
    elif system == TWO_STORIES and now == END - 10 * PERIOD:
        where = told(system, place + np.array([60.0, 0.0, 0.0]), ZERO, now)[0]
    keeps = system == NO_PLAN or (system == OLD_PLAN and now > END - 25 * PERIOD)
    return (where,) if keeps else (where, plan)


@QUICK
@given(
    order=st.permutations([THING, BESIDE, TWO_STORIES, OLD_PLAN, NO_PLAN, *FAMILIAR]),
    later=st.integers(0, 5),
)
def test_among_many_only_those_are_ignored_whose_own_word_counts(order, later):
    """Whoever is heard first, and however many only come later."""
    listener = Listener(WITH_A_THING)
    for now in range(NOW, END, PERIOD):
        for k, system in enumerate(order[: len(order) if now > NOW + 5 * PERIOD else len(order) - later]):
            place = FAR * np.array([np.cos(k), np.sin(k), 0.0])
            listener.receive(now, *strange(system, place, now))
        listener.look(now + PERIOD // 2)
    listener.look(END)
    assert {system for system in order if listener.relevance.ignores(system)} == FAMILIAR


def test_ignoring_ends_by_itself():
    """A companion that hangs looks around no more."""
    listener = after_seconds(np.array([FAR, 0.0, 0.0]), ZERO)
    listener.relevance.now += 1_000_000
    assert not listener.relevance.ignores(OTHER)


@pytest.mark.parametrize("far", [0, 8, 40])
def test_those_out_of_range_are_hardly_decoded_and_cost_the_planner_nothing(far):
    """One is near, the others are anywhere far off: what is done for each of them does not grow with their
    number, and for the plan they are not there."""
    listener = Listener()
    seconds, places = 30, {OTHER: np.array([6.0, 0.0, 0.0])}
    for k in range(far):
        places[20 + k] = 150.0 * np.array([np.cos(k), np.sin(k), 0.0])
    for tick in range(10 * seconds):
        now = NOW + tick * PERIOD
        for system, place in places.items():
            listener.receive(now, *told(system, place, ZERO, now))
        listener.look(now + PERIOD // 2)
    sent = 2 * 10 * seconds
    heard_of_the_far = listener.decoded() - sent
    # For the first seconds everybody is heard.
    assert 2 * seconds * far <= heard_of_the_far <= 0.3 * sent * far
    assert listener.world.neighbours.obstacles(NOW + seconds * 1_000_000, ZERO[None]).ids == (OTHER,)
    assert set(listener.world.neighbours.ages(NOW)) == set(places)
