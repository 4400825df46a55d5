"""Forces are continuous on every way, and away from what they keep a vehicle from."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from companion.avoidance.field.forces import repulsion
from companion.avoidance.field.methods import Influence, Method, Scene
from companion.avoidance.field.methods.approach_angle import ApproachAngle
from companion.avoidance.field.planner import Planner, build, standing
from companion.config import CompanionConfig
from companion.config.planning import ApproachAngleConfig, TurningSense
from companion.values.horizon import Array
from companion.values.obstacles import Obstacles
from companion.values.vectors import limit
from tests.companion.rig import LAWS, ZERO, obstacles, scene, vectors
from tests.companion.swarm import DT, OTHER, START, STEPS, WAYS, configured


class Meeting(NamedTuple):
    """A vehicle under way at ``velocity`` (3,) among others, around a ``target`` (3,), and its last ∇J."""

    velocity: Array
    others: Obstacles
    target: Array
    gradient: Array

    def scene(self, place: Array) -> Scene:
        return scene(place, self.others, self.gradient, self.velocity, target=self.target)


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


def influence(config: CompanionConfig, methods: Sequence[Method], seen: Scene) -> Array:
    """The limited sum of field and methods, and below it the destination (N + 2, 3)."""
    a_total, field = config.limits.a_total, config.field
    force = repulsion(seen.prediction, seen.obstacles, field.gain, 20.0 * a_total, field.braking, 1e-6 * DT)
    result = Influence(force, 1.0, seen.destination)
    for method in methods:
        result = method.influence(seen, result)
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
    seen = scene(own, obstacles([other]), target=ZERO)
    nothing = Influence(np.zeros((STEPS, 3)), 1.0, seen.destination)
    force: Array = ApproachAngle(ApproachAngleConfig(), sense).influence(seen, nothing).force[0]
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
        seen = Scene(ZERO, ZERO, np.zeros((16, 3)), way, ZERO, way, ZERO, others, way, ZERO)
        forces.append(influence(config, build(config), seen)[0])
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
