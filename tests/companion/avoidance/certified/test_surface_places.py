"""Places on a surface around a target: laws of who takes which, and five vehicles that share a circle."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
import pytest

from companion.avoidance.certified.fixed_surfaces import FixedSurfaces
from companion.avoidance.certified.margins import between, from_surfaces
from companion.avoidance.certified.peer_plans import StoredPlan
from companion.avoidance.certified.places import Places
from companion.avoidance.certified.surface_places import Candidate, Taken, place_of
from companion.avoidance.certified.told_goals import ToldGoals
from companion.avoidance.certified.way_obstacles import WayObstacles
from companion.avoidance.field.planner import Aim
from companion.config import CompanionConfig
from companion.obstacles.static import FixedObstacles
from companion.surfaces import Circle, Sphere, Surface
from companion.surfaces.ellipsoid import Ellipsoid
from companion.values.horizon import Array
from mavlink_bridge.messages import Source
from tests.companion.avoidance.certified.plans import EPOCH
from tests.companion.avoidance.certified.rough import Habits, Rough
from tests.companion.avoidance.certified.swarm import Swarm

REACH = 1.2
CIRCLE = Circle(radius=4.0, height=5.0)


def places(candidates: list[Candidate], taken: list[Taken] | None = None) -> dict[int, Array]:
    """The place that each takes, where all have received the same plans."""
    found = {}
    for one in candidates:
        nearest = one.surface.nearest(one.end)
        found[one.system] = place_of(one.system, candidates, taken or [], REACH, nearest)
    return found


def drawn(seed: int, count: int, surface: Surface) -> list[Candidate]:
    """Vehicles that come from one side."""
    rng = np.random.default_rng(seed)
    ends = rng.uniform((-12.0, -2.0, 4.0), (-4.5, 2.0, 6.0), (count, 3))
    return [Candidate(system, end, surface) for system, end in zip(range(11, 11 + count), ends, strict=True)]


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("surface", [CIRCLE, Ellipsoid(kind="ellipsoid"), Sphere(kind="sphere", radius=6.0)])
def test_all_places_are_apart_and_on_the_surface(seed: int, surface: Surface) -> None:
    found = places(drawn(seed, 7, surface))
    for one, two in combinations(found.values(), 2):
        assert np.linalg.norm(one - two) >= REACH - 1e-5
    for place in found.values():
        assert surface.nearest(place) == pytest.approx(place, abs=1e-6)


@pytest.mark.parametrize("seed", range(6))
def test_who_is_nearest_to_the_surface_takes_the_nearest_point(seed: int) -> None:
    candidates = drawn(seed, 5, CIRCLE)
    candidates.append(Candidate(99, np.array([-4.1, 0.0, 5.0]), CIRCLE))
    assert (places(candidates)[99] == CIRCLE.nearest(candidates[-1].end)).all()


def test_nobody_moves_whose_point_is_free() -> None:
    ends = [np.array([8.0 * np.cos(b), 8.0 * np.sin(b), 5.0]) for b in (0.0, 1.5, 3.0, 4.5)]
    candidates = [Candidate(system, end, CIRCLE) for system, end in enumerate(ends, 1)]
    for one, place in zip(candidates, places(candidates).values(), strict=True):
        assert (place == CIRCLE.nearest(one.end)).all()


def test_on_a_circle_the_next_place_touches_the_one_that_is_taken() -> None:
    taken = [Taken(np.array([-4.0, 0.0, 5.0]), REACH)]
    candidate = Candidate(11, np.array([-9.0, 0.1, 5.0]), CIRCLE)
    place = places([candidate], taken)[11]
    assert np.linalg.norm(place - taken[0].place) == pytest.approx(REACH, abs=1e-6)
    assert place[1] > 0.0


def test_a_place_below_keeps_others_away_where_heights_do_not_count() -> None:
    candidate = Candidate(11, np.array([-9.0, 0.1, 5.0]), CIRCLE)
    for height, moved in ((1.0, False), (0.0, True)):
        place = places([candidate], [Taken(np.array([-4.0, 0.0, 0.0]), REACH, height)])[11]
        assert (np.linalg.norm(place - CIRCLE.nearest(candidate.end)) > 0.1) == moved


def test_without_room_and_above_the_target_the_nearest_point_remains() -> None:
    crowd = [Candidate(system, np.array([-9.0, 0.01 * system, 5.0]), CIRCLE) for system in range(11, 40)]
    last = places(crowd)[39]
    assert (last == CIRCLE.nearest(crowd[-1].end)).all()
    top = Circle(radius=0.0, height=5.0)
    candidates = [Candidate(system, np.array([0.1 * system, 0.0, 9.0]), top) for system in (1, 2)]
    assert all((place == top.nearest(np.zeros(3))).all() for place in places(candidates).values())


BOX = {"box_min": [-4.0, -20.0, 2.0], "box_max": [20.0, 20.0, 12.0]}
POST = {"kind": "post", "at": [-3.0, 3.5], "radius": 0.2, "height": 3.0}
BALL = {"kind": "sphere", "at": [-1.5, 4.0, 5.0], "radius": 0.2}
SLAB = {"kind": "box", "at": [-3.0, 3.5, 5.0], "size": [0.4, 0.4, 0.4]}
AT = np.array([-1.0, 0.0, 0.0])


class Ends:
    """Newest plans of peers, of which none has said farewell."""

    def __init__(self, ends: dict[int, Array]) -> None:
        self._ends = ends
        self.left: dict[int, StoredPlan] = {}

    def ends(self) -> dict[int, Array]:
        return self._ends


def assigned(config: CompanionConfig, ends: dict[int, Array]) -> dict[int, Array]:
    """The destination of each vehicle around a target at ``AT``."""
    found = {}
    for own, end in ends.items():
        surface = config.surface_of(own)
        aim = Aim(AT + surface.nearest(end - AT), np.zeros(3), AT, AT, surface)
        places = Places(
            config, own, ToldGoals(Source(own, 1), 7), WayObstacles(config, FixedSurfaces(config))
        )
        others: Any = Ends({system: place for system, place in ends.items() if system != own})
        found[own] = places.destination(0, 0, end, aim, others)
    return found


def cylinder(obstacles: list[dict[str, Any]], planar: bool) -> CompanionConfig:
    surface = {"kind": "cylinder", "radius": 4.0, "low": 2.0, "high": 9.0}
    return CompanionConfig.model_validate(
        {
            "avoidance": "certified",
            "planar": planar,
            "surface": surface,
            "obstacles": obstacles,
            "limits": BOX,
        }
    )


@pytest.mark.parametrize("planar", [False, True])
@pytest.mark.parametrize("obstacles", [[], [POST], [BALL], [SLAB], [POST, BALL, SLAB]])
def test_no_place_is_outside_the_box_or_near_a_fixed_obstacle(
    obstacles: list[dict[str, Any]], planar: bool
) -> None:
    """Three plans end at the west of the surface, of which a part is outside the box."""
    config = cylinder(obstacles, planar)
    ends = {11: np.array([-3.7, 2.7, 5.0]), 12: np.array([-3.6, 3.0, 5.0]), 13: np.array([-3.9, 2.6, 5.0])}
    inner = config.limits.within(config.field.margin(1))
    found = assigned(config, ends)
    least = from_surfaces(config.certified, config.field, config.limits)
    fixed = FixedObstacles(config.obstacles)
    for place in found.values():
        assert (place >= np.array(inner.box_min) - 1e-5).all()
        assert (place <= np.array(inner.box_max) + 1e-5).all()
        assert (fixed.distance(place[None]) >= least - 1e-5).all()
        # Posts act as if they had no top.
        assert (fixed.distance(np.array([*place[:2], min(place[2], 2.9)])[None]) >= least - 1e-5).all()
    for one, two in combinations(found.values(), 2):
        assert np.linalg.norm(one - two) >= between(config.certified, config.field, config.limits)


@pytest.mark.parametrize("assigns", [True, False])
def test_vehicles_that_come_from_one_side_share_a_circle(monkeypatch: Any, assigns: bool) -> None:
    target = np.array([8.0, 0.0, 0.0])
    angles = np.linspace(0.0, 2.0 * np.pi, 5, endpoint=False)[1:]
    starts = np.array([[-8.0 + 4.0 * np.cos(a), 4.0 * np.sin(a), 5.0] for a in angles])
    starts[:, 2] += 0.05 * np.arange(4)

    def around(place: Array, _target: Array | None) -> Aim:
        return Aim(target + CIRCLE.nearest(place - target), np.zeros(3), target, target, CIRCLE)

    monkeypatch.setattr("tests.companion.avoidance.certified.vehicle.standing", around)
    if not assigns:
        # As in the paper: each goes to the point nearest to it.
        monkeypatch.setattr(Places, "_on_surface", lambda _self, _rest, aim, *_: aim.destination)
    swarm = Swarm(starts, Rough(delay=20_000), [Habits()] * 4, 1)

    def here(since: int, system: int) -> Array:
        vehicle = swarm.vehicles[system - 1]
        return vehicle._here(EPOCH + since, since)

    swarm.run(6_000_000, here)
    ends = np.array([vehicle.plan(swarm.epochs()[-1]).position_m for vehicle in swarm.vehicles]) - target
    arrived = np.linalg.norm(ends - CIRCLE.nearest(ends), axis=1) < 0.3
    assert arrived.all() == assigns
    assert swarm.least() >= swarm.d - 1e-9
