"""Laws of the planner in a loop: vehicles that follow their plans meet nobody and arrive, whatever the way.

The vehicles are points that follow their plans exactly; sensors, links and autopilots are tested elsewhere.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from companion.values.obstacles import Obstacles
from companion.world import World
from mavlink_bridge.frames import FleetFrame
from outrider import (
    InputError,
    Neighbour,
    Obstacle,
    Plan,
    Planner,
    PlannerConfig,
    Post,
    Sphere,
    Step,
    Target,
)
from outrider.planner.surroundings import Surroundings

BOX = {"box_min": (-30.0, -30.0, 1.0), "box_max": (30.0, 30.0, 12.0)}
FIELD = PlannerConfig(limits=BOX, field={"d_min": 1.0}, rates={"replan_us": 40_000})
CERTIFIED = PlannerConfig(avoidance="certified", turning_sense="right", limits=BOX, field={"d_min": 1.0})
DT = 0.04
STATE = (0.0, 0.0, 5.0), (0.0, 0.0, 0.0)
START = 1.7e9
"""Unix time: the loop must not lose microseconds in a float."""


class Fleet:
    """Vehicles that follow their plans exactly, and exchange plans or packets without loss or delay."""

    def __init__(self, planners: list[Planner], places: np.ndarray, *, shares: bool) -> None:
        self.planners, self.x, self.v = planners, places.copy(), np.zeros_like(places)
        self.shares, self.turn = shares, 0
        self.plans: list[Plan | None] = [None] * len(planners)
        self.packets: list[list[bytes]] = [[] for _ in planners]
        self.least = np.inf

    @property
    def now(self) -> float:
        return START + DT * self.turn

    def step(self, ways: Callable[[int], dict[str, Any]]) -> list[Step]:
        """One step of all; ``ways(k)`` gives the k-th planner's goal, target and obstacles."""
        steps = []
        for k, planner in enumerate(self.planners):
            others = [
                Neighbour(other.id, self.x[j], self.v[j], self.plans[j] if self.shares else None)
                for j, other in enumerate(self.planners)
                if j != k
            ]
            heard = [packet for j, sent in enumerate(self.packets) if j != k for packet in sent]
            steps.append(
                planner.step(self.now, self.x[k], self.v[k], neighbours=others, packets=heard, **ways(k))
            )
        self.packets, self.plans = [list(step.packets) for step in steps], [step.plan for step in steps]
        self.turn += 1
        for k, step in enumerate(steps):
            if step.plan is not None:
                self.x[k], self.v[k], _ = step.plan.at(self.now)
        apart = np.linalg.norm(self.x[:, None] - self.x[None], axis=-1)
        self.least = min(self.least, float(apart[np.triu_indices(len(apart), 1)].min(initial=np.inf)))
        return steps


def ring(count: int, radius: float) -> np.ndarray:
    angle = 2.0 * np.pi * np.arange(count) / count
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(count, 5.0)])


@pytest.mark.parametrize(("config", "shares"), [(FIELD, True), (FIELD, False), (CERTIFIED, False)])
def test_four_swap_places_without_meeting(config: PlannerConfig, shares: bool) -> None:
    places = ring(4, 5.0)
    fleet = Fleet([Planner(config, id=k + 1) for k in range(4)], places, shares=shares)
    goals = places * (-1.0, -1.0, 1.0)
    while fleet.turn < 500 and np.linalg.norm(fleet.x - goals, axis=1).max() > 0.3:
        steps = fleet.step(lambda k: {"goal": goals[k]})
    assert fleet.turn < 500
    assert fleet.least > config.field.d_min
    assert all(bool(step.packets) <= (config is CERTIFIED) for step in steps)


@pytest.mark.parametrize("config", [FIELD, CERTIFIED])
@pytest.mark.parametrize("kind", ["configured", "given", "array", "moving"])
def test_an_obstacle_on_the_way_is_not_touched(config: PlannerConfig, kind: str) -> None:
    """A ball and a post, as settings or as arguments; or a ball that comes along the way."""
    sphere, post = ((2.0, 0.1, 5.0), 0.8), ((6.0, -0.1), 0.5)
    given: Any = ()
    if kind == "configured":
        fixed = (
            Sphere(kind="sphere", at=sphere[0], radius=sphere[1]),
            Post(kind="post", at=post[0], radius=post[1]),
        )
        config = config.model_copy(update={"obstacles": fixed})
    elif kind == "given":
        given = [Obstacle(*sphere), Obstacle((*post[0], 0.0), post[1], upright=True)]
    elif kind == "array":
        given = np.array([[*sphere[0], sphere[1]], [*post[0], 5.0, post[1]]])
    planner = Planner(config)
    x, v, least = np.array([-3.0, 0.0, 5.0]), np.zeros(3), np.inf
    for turn in range(600):
        now = START + DT * turn
        away = [np.linalg.norm(x - sphere[0]) - sphere[1], np.linalg.norm(x[:2] - post[0]) - post[1]]
        if kind == "moving":
            at = np.array([8.0, 0.1, 5.0]) - (1.0 * DT * turn, 0.0, 0.0)
            given, away = [Obstacle(at, 0.5, velocity=(-1.0, 0.0, 0.0))], [np.linalg.norm(x - at) - 0.5]
        least = min(least, *away)
        step = planner.step(now, x, v, goal=(10.0, 0.0, 5.0), obstacles=given)
        if step.plan is not None:
            x, v, _ = step.plan.at(now + DT)
        if np.linalg.norm(x - (10.0, 0.0, 5.0)) < 0.3:
            break
    assert np.linalg.norm(x - (10.0, 0.0, 5.0)) < 0.3
    assert least > config.field.d_min


@pytest.mark.parametrize("config", [FIELD, CERTIFIED])
def test_a_walking_target_is_escorted_and_faced(config: PlannerConfig) -> None:
    fleet = Fleet([Planner(config, id=k + 1) for k in range(3)], ring(3, 7.0), shares=config is FIELD)
    target = Target((0.0, 0.0, 0.0))
    for _ in range(400):
        target = Target((1.0 * DT * fleet.turn, 0.0, 0.0), velocity=(1.0, 0.0, 0.0))
        way = {"target": target}
        steps = fleet.step(lambda _k, way=way: way)  # type: ignore[misc]
    offsets = fleet.x - np.asarray(target.position)
    surface = config.surface.nearest(offsets)
    assert np.linalg.norm(offsets - surface, axis=1).max() < 1.0
    assert fleet.least > config.field.d_min
    for offset, step in zip(offsets, steps, strict=True):
        assert step.setpoint is not None
        facing = np.arctan2(-offset[1], -offset[0])
        assert np.cos(step.setpoint.yaw - facing) > np.cos(0.1)


def test_an_own_surface_takes_the_place_of_the_configured_one() -> None:
    class Wall:
        def nearest(self, offset: np.ndarray) -> tuple[float, float, float]:
            return 6.0, float(offset[1]), 4.0

    planner, x, v = Planner(FIELD, surface=Wall()), np.array([0.0, 3.0, 5.0]), np.zeros(3)
    for turn in range(200):
        step = planner.step(DT * turn, x, v, target=Target((1.0, 0.0, 0.0)))
        assert step.plan is not None
        x, v, _ = step.plan.at(DT * (turn + 1))
    np.testing.assert_allclose(x, (7.0, 3.0, 4.0), atol=0.05)


def test_an_own_method_bends_the_way() -> None:
    class Sideways:
        def influence(self, scene: Any, influence: Any) -> Any:
            return influence._replace(force=influence.force + np.array([0.0, 3.0, 0.0]))

    bent = []
    for methods in ((), (Sideways(),)):
        step = Planner(FIELD, methods=methods).step(
            0.0, (0.0, 0.0, 5.0), (0.0, 0.0, 0.0), goal=(3.0, 0.0, 5.0)
        )
        assert step.plan is not None
        bent.append(step.plan)
    # The bounds of the acceleration move with the force: with u_max 2 m/s² at least 1 m/s² is left.
    assert np.abs(bent[0].accelerations[:, 1]).max() < 1e-6
    assert bent[1].accelerations[:, 1].min() > 1.0 - 1e-6


def test_without_goal_and_target_the_vehicle_holds_its_position() -> None:
    planner = Planner(FIELD)
    x, v = np.array([1.0, 2.0, 5.0]), np.zeros(3)
    for turn in range(50):
        step = planner.step(DT * turn, x, v, goal=(8.0, 2.0, 5.0) if turn < 25 else None)
        assert step.plan is not None
        x, v, _ = step.plan.at(DT * (turn + 1))
    held = x
    for turn in range(50, 250):
        step = planner.step(DT * turn, x, v)
        assert step.plan is not None
        x, v, _ = step.plan.at(DT * (turn + 1))
    assert np.linalg.norm(v) < 0.05
    assert np.linalg.norm(x - held) < 3.0


def test_a_new_flight_is_as_the_first() -> None:
    planner = Planner(FIELD)
    first = planner.step(5.0, (0.0, 0.0, 5.0), (0.0, 0.0, 0.0), goal=(3.0, 0.0, 5.0)).plan
    planner.step(6.0, (1.0, 0.0, 5.0), (0.0, 1.0, 0.0), goal=(0.0, 3.0, 5.0))
    planner.reset()
    again = planner.step(5.0, (0.0, 0.0, 5.0), (0.0, 0.0, 0.0), goal=(3.0, 0.0, 5.0)).plan
    assert first is not None
    assert again is not None
    assert np.array_equal(first.positions, again.positions)


def test_fixed_obstacles_and_the_target_are_those_of_the_world_picture() -> None:
    """The picture of arrays and that of messages have the same distances and places."""
    config = FIELD.model_copy(
        update={
            "obstacles": (Sphere(kind="sphere", at=(2.0, 0.1, 5.0), radius=0.8),),
            "field": FIELD.field.model_copy(update={"position_sigma": 0.1}),
        }
    )
    fleet = FleetFrame(47.0, 8.0, 0.0)
    world, local = World(config, 1, 10, fleet), fleet.local(47.0, 8.0, 0.0)
    prediction = np.broadcast_to((0.0, 0.0, 5.0), (config.horizon.steps + 1, 3))
    ours = Surroundings(config, local)
    own = np.array([0.0, 0.0, 5.0]), np.zeros(3), 0.0
    view = ours.take(0, own, None, (Neighbour(7, (3.0, 0.0, 5.0)),), (Obstacle((2.0, 0.1, 5.0), 0.8),))
    of_messages: Obstacles = world.obstacles(0, view, prediction)
    found = ours.obstacles(0, view, prediction)
    for row in (1, 2):
        np.testing.assert_allclose(found.positions[row], of_messages.positions[0])
        for name in ("d_min", "d_safe"):
            assert getattr(found, name)[row] == pytest.approx(getattr(of_messages, name)[0])
    assert found.d_min[0] == pytest.approx(config.field.d_min + config.field.margin(2))


# One clear error

WRONG: dict[str, tuple[Callable[[], object], str]] = {
    "a position of two numbers": (
        lambda: Planner().step(0.0, (0.0, 0.0), STATE[1]),
        "position: has shape (2,); allowed: (3,), m",
    ),
    "a velocity with NaN": (
        lambda: Planner().step(0.0, STATE[0], (0.0, 0.0, np.nan)),
        "velocity: holds a value",
    ),
    "words": (lambda: Planner().step(0.0, "abc", STATE[1]), "position: is no array of numbers"),
    "a time that is no number": (lambda: Planner().step(np.nan, *STATE), "now: is nan; allowed"),
    "a goal that is a matrix": (
        lambda: Planner().step(0.0, *STATE, goal=np.eye(3)),
        "goal: has shape (3, 3)",
    ),
    "a target as an array": (
        lambda: Planner().step(0.0, *STATE, target=np.zeros(3)),  # type: ignore[arg-type]
        "target: is a ndarray; allowed: a Target",
    ),
    "neighbours of five columns": (
        lambda: Planner().step(0.0, *STATE, neighbours=np.zeros((2, 5))),
        "neighbours: has shape (2, 5); allowed: (M, 6), m and m/s",
    ),
    "a neighbour twice": (
        lambda: Planner().step(0.0, *STATE, neighbours=[Neighbour(2, (1, 0, 5)), Neighbour(2, (2, 0, 5))]),
        "neighbours: id 2 is there twice",
    ),
    "the own id": (
        lambda: Planner(id=2).step(0.0, *STATE, neighbours=[Neighbour(2, (1, 0, 5))]),
        "neighbours: id 2 is the planner's own id",
    ),
    "a neighbour's position": (lambda: Neighbour(3, (1.0, 2.0)), "position of neighbour 3: has shape (2,)"),
    "an id": (lambda: Planner(id=0), "id: is 0; allowed: a whole number from 1 to 255"),
    "a radius": (lambda: Obstacle((0, 0, 0), -1.0), "radius of an obstacle: is -1; allowed"),
    "a config": (lambda: Planner({"methods": ["swivel"]}), "config: is a dict"),  # type: ignore[arg-type]
    "methods of committed plans": (
        lambda: Planner(CERTIFIED, methods=[object()]),
        "committed plans use none",
    ),  # type: ignore[list-item]
    "packets of text": (lambda: Planner().step(0.0, *STATE, packets=["x"]), "packets: one is a str"),  # type: ignore[list-item]
}


@pytest.mark.parametrize("what", WRONG)
def test_wrong_arguments_are_one_clear_error(what: str) -> None:
    call, said = WRONG[what]
    with pytest.raises(InputError) as error:
        call()
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_time_does_not_go_back() -> None:
    planner = Planner()
    planner.step(1.0, *STATE)
    with pytest.raises(InputError, match="before the last step"):
        planner.step(0.9, *STATE)


def test_a_plan_of_arrays_is_the_plan_that_is_shared() -> None:
    plan = Planner(FIELD).step(3.0, *STATE, goal=(4.0, 0.0, 5.0)).plan
    assert plan is not None
    again = Plan.of(
        3.0, plan.times[1] - plan.times[0], plan.positions[0], plan.velocities[0], plan.accelerations
    )
    np.testing.assert_array_equal(again.positions, plan.positions)
    np.testing.assert_array_equal(again.times, plan.times)
    motion = plan.at(3.05)
    step = 1e-5
    rate = (plan.at(3.05 + step).position - plan.at(3.05 - step).position) / (2 * step)
    np.testing.assert_allclose(rate, motion.velocity, atol=1e-6)


def test_garbage_packets_do_no_harm() -> None:
    planner = Planner(CERTIFIED)
    random = np.random.default_rng(1)
    for turn in range(30):
        planner.step(START + DT * turn, *STATE, packets=[random.bytes(60), b"", b"\xfd" * 300])
    assert planner.step(START + 2.0, *STATE).plan is not None


def test_an_array_of_neighbours_gets_ids_beside_the_own() -> None:
    rows = np.array([[0.0, 6.0, 5.0, 0.0, 0.0, 0.0], [6.0, 0.0, 5.0, 0.0, 0.0, 0.0]])
    named = [Neighbour(2, rows[0, :3], rows[0, 3:]), Neighbour(3, rows[1, :3], rows[1, 3:])]
    once, again = (
        Planner(FIELD).step(0.0, *STATE, goal=(8.0, 8.0, 5.0), neighbours=others) for others in (rows, named)
    )
    assert once.plan is not None
    assert again.plan is not None
    np.testing.assert_array_equal(once.plan.positions, again.plan.positions)
