"""Laws of the whole swarm: mirrored, turned, elsewhere, later, with vehicles exchanged it flies alike; its
forces are continuous and away; the swivel vanishes on the surface.

Point masses fly what they plan, all at once, each by what the others planned a step before. Rounding, 1e-15
at first, grows in every encounter, so flights are short: within 5 s the worst of some hundred were 7e-7 m
apart. A sense that is not mirrored throws them apart by decimetres at least.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pytest
from companion_rig import LAWS, QUICK, ZERO, numbers, obstacles, vectors
from hypothesis import assume, given
from hypothesis import strategies as st

from companion.config import ApproachAngleConfig, CompanionConfig, TurningSense
from companion.dqmpc import Dqmpc
from companion.forces import Obstacles, limit, repulsion
from companion.horizon import Array, roll_out
from companion.methods import Influence, Method, Scene
from companion.methods.approach_angle import ApproachAngle
from companion.methods.swivel import Swivel
from companion.planner import Aim, Planner, build, standing
from companion.surfaces import Circle, Cylinder, Sphere, Surface

START = 1_767_225_600_000_000
DT, STEPS = 100_000, 16
AHEAD = 1e-6 * DT * STEPS
CLOSE = 1e-4
"""m."""
MIRROR = np.diag([1.0, -1.0, 1.0])
QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
CIRCLE = Circle()
OTHER = {"own": "own", "right": "left"}

METHODS = {
    "baseline": ("baseline",),
    "swivel": ("swivel",),
    "approach": ("approach_angle",),
    "tangential": ("tangential",),
    "both": ("swivel", "tangential"),
}
WAYS = [(name, sense) for name in METHODS for sense in OTHER if (name, sense) != ("baseline", "right")]
"""Without a method there are no senses."""


def configured(name: str, sense: str) -> CompanionConfig:
    return CompanionConfig.model_validate({"methods": METHODS[name], "turning_sense": sense})


# A swarm


class Swarm(NamedTuple):
    """Vehicles (K, 3) with their velocities and goals (None: they escort), the target (3,) and its velocity,
    and a ball (3,) in the way."""

    places: Array
    velocities: Array
    goals: Array | None
    target: Array
    speed: Array
    ball: Array

    def seen(self, matrix: Array, shift: Array = ZERO) -> Swarm:
        """In another frame, an image of this one."""
        goals = None if self.goals is None else self.goals @ matrix.T + shift
        return Swarm(
            self.places @ matrix.T + shift,
            self.velocities @ matrix.T,
            goals,
            matrix @ self.target + shift,
            matrix @ self.speed,
            matrix @ self.ball + shift,
        )

    def ordered(self, order: Sequence[int]) -> Swarm:
        rows = list(order)
        goals = None if self.goals is None else self.goals[rows]
        return self._replace(places=self.places[rows], velocities=self.velocities[rows], goals=goals)

    def aim(self, k: int, seconds: float, place: Array) -> Aim:
        here = self.target + seconds * self.speed
        if self.goals is not None:
            return standing(self.goals[k], here)
        end = here + AHEAD * self.speed
        return Aim(end + CIRCLE.nearest(place - here), self.speed, here, end, CIRCLE)


def swap(seed: int) -> Swarm:
    """Five from a ring to the other side of it."""
    random = np.random.default_rng([seed, 1])
    angle = 0.4 * np.pi * np.arange(5) + random.uniform(-0.3, 0.3, 5)
    places = np.column_stack([6.0 * np.cos(angle), 6.0 * np.sin(angle), np.full(5, 5.0)])
    places += random.uniform(-0.5, 0.5, (5, 3))
    goals = np.roll(places, 2, axis=0) + random.uniform(-0.5, 0.5, (5, 3))
    velocities = random.uniform(-1, 1, (5, 3)) * [1.0, 1.0, 0.3]
    target, ball = np.append(random.uniform(-1, 1, 2), 0.0), np.append(random.uniform(-1, 1, 2), 5.0)
    return Swarm(places, velocities, goals, target, ZERO, ball)


def escort(seed: int) -> Swarm:
    """Five come abreast to a target under way."""
    random = np.random.default_rng([seed, 2])
    places = np.column_stack([np.full(5, -8.0), np.linspace(-3.4, 3.4, 5), np.full(5, 5.0)])
    places += random.uniform(-0.5, 0.5, (5, 3))
    velocities = random.uniform(-1, 1, (5, 3)) * [1.0, 1.0, 0.3]
    target, speed = (np.append(random.uniform(-1, 1, 2), 0.0) for _ in range(2))
    ball = np.array([random.uniform(-4, -3), random.uniform(-1, 1), 5.0])
    return Swarm(places, velocities, None, target, speed, ball)


SWARMS = {"swap": swap(3), "escort": escort(3)}
flights = pytest.mark.parametrize(
    ("name", "sense", "which"), [(*way, which) for which in SWARMS for way in WAYS]
)


class Flown(NamedTuple):
    """``places`` (T, K, 3) m and ``gradients`` (T, K): ‖∇J‖ of the plans made there."""

    places: Array
    gradients: Array


def fly(
    config: CompanionConfig,
    swarm: Swarm,
    seconds: float = 4.0,
    epoch: int = START,
    names: Sequence[int] = (1, 2, 3, 4, 5),
) -> Flown:
    count, field = len(swarm.places), config.field
    planners = [Planner(config) for _ in range(count)]
    still = np.zeros((STEPS, 3))
    horizons = [roll_out(epoch, DT, *state, still) for state in zip(*swarm[:2], strict=True)]
    ball = np.tile(swarm.ball, (1, STEPS, 1))
    fixed = Obstacles((1000,), ball, np.array([1.0]), np.array([3.5]), np.array([0.5]))
    places, gradients = [], []
    for now in range(epoch, epoch + round(1e6 * seconds), DT):
        predictions = np.array([horizon.positions(now, STEPS, DT) for horizon in horizons])
        motions, plans = [horizon.at(now) for horizon in horizons], []
        for k, motion in enumerate(motions):
            others = [j for j in range(count) if j != k]
            d_min, d_safe = np.full(count - 1, field.d_min), np.full(count - 1, field.d_safe)
            seen = Obstacles(tuple(names[j] for j in others), predictions[others], d_min, d_safe)
            aim = swarm.aim(k, 1e-6 * (now - epoch), motion.position)
            plans.append(
                planners[k].plan(
                    now, motion.position, motion.velocity, predictions[k], aim, seen.joined(fixed)
                )
            )
        horizons = [plan.horizon for plan in plans]
        places.append([motion.position for motion in motions])
        gradients.append([np.linalg.norm(plan.gradient) for plan in plans])
    return Flown(np.array(places), np.array(gradients))


@cache
def flown(name: str, sense: str, which: str) -> Array:
    return fly(configured(name, sense), SWARMS[which]).places


@flights
def test_in_these_flights_vehicles_meet_and_every_method_acts(name, sense, which):
    places = flown(name, sense, which)
    apart = np.linalg.norm(places[:, :, None] - places[:, None], axis=3)
    assert apart[:, ~np.eye(5, dtype=bool)].min() < 2.0
    if name != "baseline":
        assert np.abs(places - flown("baseline", "own", which)).max() > 0.5
        # A common sense is another flight, or its mirror image would say nothing about senses.
        assert np.abs(flown(name, "right", which) - flown(name, "own", which)).max() > 0.5


@flights
def test_a_mirrored_swarm_flies_in_the_mirror(name, sense, which):
    """To the other side, where the sense is common to all."""
    mirrored = fly(configured(name, OTHER[sense]), SWARMS[which].seen(MIRROR)).places
    np.testing.assert_allclose(mirrored, flown(name, sense, which) @ MIRROR.T, atol=CLOSE)


@flights
def test_a_swarm_flies_alike_wherever_it_is_and_whichever_way_it_faces(name, sense, which):
    """A quarter turned, because bounds are per axis, and on its level, because the box has a floor near
    by."""
    shift = np.array([2.3, -1.7, 0.0])
    elsewhere = fly(configured(name, sense), SWARMS[which].seen(QUARTER, shift)).places
    np.testing.assert_allclose(elsewhere, flown(name, sense, which) @ QUARTER.T + shift, atol=CLOSE)


@flights
def test_exchanged_vehicles_exchange_their_flights(name, sense, which):
    """Not bit for bit: forces are then summed in another order."""
    order = (3, 0, 4, 2, 1)
    names = [1 + k for k in order]
    exchanged = fly(configured(name, sense), SWARMS[which].ordered(order), names=names).places
    np.testing.assert_allclose(exchanged, flown(name, sense, which)[:, list(order)], atol=CLOSE)


@flights
def test_neither_names_nor_the_time_of_day_matter(name, sense, which):
    """Bit for bit."""
    again = fly(configured(name, sense), SWARMS[which], epoch=START - 987_654_321, names=(9, 3, 200, 11, 5))
    np.testing.assert_array_equal(again.places, flown(name, sense, which))


# Forces


class Meeting(NamedTuple):
    """A vehicle under way at ``velocity`` (3,) among others, around a ``target`` (3,), and its last ∇J."""

    velocity: Array
    others: Obstacles
    target: Array
    gradient: Array

    def scene(self, place: Array) -> Scene:
        prediction = place + 1e-6 * DT * np.arange(STEPS)[:, None] * self.velocity
        destination = self.target + CIRCLE.nearest(place - self.target)
        return Scene(
            place,
            self.velocity,
            prediction,
            destination,
            ZERO,
            destination - place,
            self.target,
            self.others,
            self.gradient,
            self.target,
            CIRCLE,
        )


MOST, FASTEST = 3, 7.0
"""In the meetings below: others, and m/s at which two close."""


def among(random: np.random.Generator) -> tuple[Meeting, Array, Array]:
    """Three others all around, anywhere with respect to the circle; a way (3,), (3,) in some direction."""
    place = np.append(random.uniform(-6, 6, 2), random.uniform(4, 6))
    places = place + random.uniform(-4, 4, (3, 3)) * [1.0, 1.0, 0.4]
    velocity, *speeds = random.uniform(-2.4, 2.4, (4, 3)) * [1.0, 1.0, 0.3]
    target = np.append(random.uniform(-4, 4, 2), 0.0)
    there = place + random.uniform(-0.6, 0.6, 3) * [1.0, 1.0, 0.3]
    return Meeting(velocity, obstacles(places, speeds), target, random.uniform(-5, 5, 3)), place, there


def ahead(random: np.random.Generator) -> tuple[Meeting, Array, Array]:
    """Two others that come towards one on its way in, of which it goes half a metre."""
    way = random.uniform(-np.pi, np.pi)
    course = np.array([np.cos(way), np.sin(way), 0.0])
    place = np.append(-random.uniform(8, 10) * course[:2], random.uniform(4, 6))
    places = place + random.uniform(3.5, 5.5, (2, 1)) * course + random.uniform(-1, 1, (2, 3))
    velocity = random.uniform(1.0, 3.0) * course + random.uniform(-0.3, 0.3, 3)
    speeds = -random.uniform(0.0, 2.0, (2, 1)) * course + random.uniform(-0.3, 0.3, (2, 3))
    return Meeting(velocity, obstacles(places, speeds), ZERO, 5.0 * course), place, place + 0.5 * course


def influence(config: CompanionConfig, methods: Sequence[Method], scene: Scene) -> Array:
    """The limited sum of field and methods, and below it the destination (N + 2, 3)."""
    a_total, field = config.limits.a_total, config.field
    force = repulsion(scene.prediction, scene.obstacles, field.gain, 20.0 * a_total, field.braking, 1e-6 * DT)
    result = Influence(force, 1.0, scene.destination)
    for method in methods:
        result = method.influence(scene, result)
    return np.vstack([limit(result.force, a_total), result.destination])


def step(config: CompanionConfig, of: Meeting, here: Array, there: Array) -> float:
    """By how much the influence changes for a vehicle that goes from here to there: what it latches it has
    latched here."""
    influences = []
    for place in (here, there):
        methods = build(config)
        influence(config, methods, of.scene(here))
        influences.append(influence(config, methods, of.scene(place)))
    return float(np.abs(influences[1] - influences[0]).max())


CELLS, HALVINGS = 12, 18


def least_step(config: CompanionConfig, of: Meeting, start: Array, end: Array) -> float:
    """What is left of the two largest steps on a way if one looks ever more closely: of a jump all."""
    edges = np.linspace(start, end, CELLS + 1)
    steps = [step(config, of, *pair) for pair in pairwise(edges)]
    left = 0.0
    for k in np.argsort(steps)[-2:]:
        low, high = edges[k], edges[k + 1]
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            if step(config, of, low, middle) >= step(config, of, middle, high):
                high = middle
            else:
                low = middle
        left = max(left, step(config, of, low, high))
    return left


def steepest(config: CompanionConfig) -> float:
    """m/s² per m: how fast one source's field grows at its clamp, |F'| = K (π/2w)² cot² z with cot z at most
    F · 2w/(πK) + π/2; and as the distance that is left after braking shrinks faster than the distance."""
    field, width = config.field, config.field.d_safe - config.field.d_min
    assert field.braking is not None
    cot = 20.0 * config.limits.a_total * 2.0 * width / (np.pi * field.gain) + 0.5 * np.pi
    # The gradient of ċ²/(2a): ċ/(a dt) for each of the two directions whose difference ċ is.
    return float(field.gain * (0.5 * np.pi / width * cot) ** 2 * (1.0 + 2e6 * FASTEST / (field.braking * DT)))


@pytest.mark.parametrize(("name", "sense"), WAYS)
def test_nothing_jumps_on_the_way(name, sense):
    """Whatever acts, and where the destination is: a fraction of a micrometre further on it is the same."""
    config = configured(name, sense)
    bound = MOST * steepest(config) / CELLS / 2**HALVINGS
    assert bound < 0.1
    for seed in range(12):
        for meet in (among, ahead):
            assert least_step(config, *meet(np.random.default_rng([seed, 3]))) < bound


def pushed(own: Array, other: Array, sense: TurningSense) -> Array:
    """F_ang (3,) now of one that is still under way to the circle about the origin."""
    scene = Meeting(ZERO, obstacles([other]), ZERO, np.array([10.0, 0.0, 0.0])).scene(own)
    nothing = Influence(np.zeros((STEPS, 3)), 1.0, scene.destination)
    force: Array = ApproachAngle(ApproachAngleConfig(), sense).influence(scene, nothing).force[0]
    return force


@pytest.mark.parametrize("sense", OTHER)
def test_who_falls_behind_is_let_go_by_and_by(sense):
    """The way left is 2 m: who is further than 5 m from its end is behind by more than d_safe."""
    forces = [
        pushed(np.array([-6.0, 0.0, 5.0]), np.array([-9.0 + x, 0.0, 5.0]), sense) for x in (-1e-3, 1e-3)
    ]
    assert np.linalg.norm(forces[1] - forces[0]) < 0.1


@pytest.mark.parametrize("sense", OTHER)
def test_who_passes_the_surface_is_pushed_on_as_before(sense):
    """With the ∇J that is left of its way: it does not stop there."""
    other = np.array([4.0 * np.cos(0.3), 4.0 * np.sin(0.3), 5.0])
    forces = [pushed(np.array([4.0 + x, 0.0, 5.0]), other, sense) for x in (-1e-3, 1e-3)]
    assert np.linalg.norm(forces[1] - forces[0]) < 0.1


@pytest.mark.parametrize("height", [-2.0, 2.0])
def test_what_is_right_above_or_below_is_passed_on_neither_side(height):
    """On the way up or down, a millimetre to the left of it and to the right."""
    config, way = configured("tangential", "right"), np.array([3.0, 0.0, 2.0 * height])
    forces = []
    for side in (-1e-3, 1e-3):
        others = obstacles([[0.0, side, height]])
        scene = Scene(ZERO, ZERO, np.zeros((16, 3)), way, ZERO, way, ZERO, others, way, ZERO)
        forces.append(influence(config, build(config), scene)[0])
    assert np.linalg.norm(forces[1] - forces[0]) < 0.1


@LAWS
@given(
    place=vectors(4.0),
    velocity=vectors(4.0),
    own=vectors(4.0),
    goal=vectors(8.0),
    name=st.sampled_from(["baseline", "swivel", "tangential", "both"]),
    sense=st.sampled_from(["own", "right", "left"]),
)
def test_no_plan_is_pushed_towards_the_only_obstacle(place, velocity, own, goal, name, sense):
    """Past it, or away from it: now, while further on it may lie elsewhere than the band saw it."""
    assume(np.linalg.norm(place) > 1e-3)
    here = np.array([0.0, 0.0, 6.5])
    others = obstacles([here + place], [velocity])
    planner = Planner(configured(name, sense))
    prediction = here + 1e-6 * DT * np.arange(STEPS)[:, None] * own
    aim = standing(here + goal * [1.0, 1.0, 0.3], here + np.array([3.0, 4.0, 0.0]))
    for now in range(START, START + 3 * DT, DT):
        plan = planner.plan(now, here, own, prediction, aim, others)
        assert plan.force[0] @ place <= 1e-9


@pytest.mark.parametrize("reach", [2.0, 3.0, 5.0, 7.0])
@pytest.mark.parametrize("bearing", [0.0, 1.0, 3.1])
def test_two_at_nearly_one_angle_are_pushed_apart_on_either_side_of_the_surface(reach, bearing):
    angles = bearing + np.array([0.15, -0.15])
    places = np.column_stack([reach * np.cos(angles), reach * np.sin(angles), [5.0, 5.0]])
    for own, other in (places, places[::-1]):
        assert pushed(own, other, "own") @ (own - other) > 0.0


# The swivel


ROUND: list[Surface] = [CIRCLE, Cylinder(kind="cylinder"), Sphere(kind="sphere", radius=5.0)]
"""On which a turn about the vertical by an angle goes no further than that times the radius."""
WIDEST = 5.0


@LAWS
@given(offset=vectors(9.0), other=vectors(9.0), surface=st.sampled_from(ROUND))
def test_the_swivel_goes_with_the_way_that_is_left(offset, other, surface):
    """A vehicle that hovers: ∇J is twice the way, and a little for the last input."""
    config = configured("swivel", "own")
    destination, target = surface.nearest(offset), np.array([1.0, -2.0, 0.0])
    way, here = float(np.linalg.norm(offset - destination)), target + offset
    gradient = Dqmpc(config.horizon, config.cost, config.limits).gradient(
        np.zeros((STEPS, 3)), here, ZERO, target + destination, ZERO
    )
    scene = Scene(
        here,
        ZERO,
        np.tile(here, (STEPS, 1)),
        target + destination,
        ZERO,
        destination - offset,
        target,
        obstacles([target + other]),
        gradient,
        target,
        surface,
    )
    nothing = Influence(np.zeros((STEPS, 3)), 1.0, scene.destination)
    swivelled = Swivel(config.swivel, "own").influence(scene, nothing).destination
    assert np.linalg.norm(swivelled - scene.destination) <= 2.02 * config.swivel.k_s * way * WIDEST + 1e-6


@QUICK
@given(
    offset=vectors(9.0),
    aside=numbers(0.8, 2.0),
    speed=vectors(1.0),
    surface=st.sampled_from(ROUND),
    name=st.sampled_from(list(METHODS)),
    sense=st.sampled_from(["own", "right", "left"]),
)
def test_who_is_on_the_surface_stays_there(offset, aside, speed, surface, name, sense):
    """And goes with the target, whoever goes along beside it out of d_safe."""
    place, planner = surface.nearest(offset), Planner(configured(name, sense))
    assume(np.hypot(*place[:2]) > 0.1)
    c, s = np.cos(aside), np.sin(aside)
    other = place @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    assume(np.linalg.norm(other - place) > 3.0)
    speed = speed * [1.0, 1.0, 0.0]
    ahead = 1e-6 * DT * np.arange(STEPS)[:, None] * speed
    for k in range(5):
        target = np.array([1.0, -2.0, 0.0]) + 1e-6 * DT * k * speed
        here, end = target + place, target + AHEAD * speed
        aim = Aim(end + surface.nearest(place), speed, target, end, surface)
        others = obstacles([target + other], [speed])
        plan = planner.plan(START + k * DT, here, speed, here + ahead, aim, others)
        knots = plan.horizon.knots
        np.testing.assert_allclose(knots[:STEPS, 0:3], here + ahead, atol=1e-6)
        np.testing.assert_allclose(knots[:, 3:6], np.tile(speed, (STEPS + 1, 1)), atol=1e-6)
        np.testing.assert_allclose(plan.gradient, ZERO, atol=1e-6)


@pytest.mark.parametrize("sense", OTHER)
@pytest.mark.parametrize("name", ["swivel", "both"])
@pytest.mark.parametrize("seed", [1, 2])
def test_a_ring_that_swivelled_comes_to_rest(name, sense, seed):
    """Bearings from the target turn on the way, and not at all on the surface, where ∇J is zero."""
    swarm = escort(seed)._replace(speed=ZERO, ball=np.array([0.0, 0.0, -50.0]))
    places, gradients = fly(configured(name, sense), swarm, seconds=25.0)
    off = places - swarm.target
    bearing = np.unwrap(np.arctan2(off[..., 1], off[..., 0]), axis=0)
    rate = np.abs(np.diff(bearing, axis=0)) / (1e-6 * DT)
    assert rate.max() > 0.1
    np.testing.assert_allclose(off[-1], CIRCLE.nearest(off[-1]), atol=0.01)
    assert rate[-10:].max() < 1e-3
    assert gradients[-1].max() < 0.01
