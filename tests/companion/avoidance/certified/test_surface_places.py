"""Places on a surface around a target: laws of who takes which, and five vehicles that share a circle."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
import pytest

from companion.avoidance.certified.places import Places
from companion.avoidance.certified.surface_places import Comer, Taken, place_of
from companion.avoidance.field.planner import Aim
from companion.surfaces import Circle, Sphere, Surface
from companion.surfaces.ellipsoid import Ellipsoid
from companion.values.horizon import Array
from tests.companion.avoidance.certified.plans import EPOCH
from tests.companion.avoidance.certified.swarm import Habits, Rough, Swarm

REACH = 1.2
CIRCLE = Circle(radius=4.0, height=5.0)


def places(comers: list[Comer], taken: list[Taken] | None = None) -> dict[int, Array]:
    """The place that each takes, where all have received the same plans."""
    found = {}
    for one in comers:
        nearest = one.surface.nearest(one.end)
        found[one.system] = place_of(one.system, comers, taken or [], REACH, nearest)
    return found


def drawn(seed: int, count: int, surface: Surface) -> list[Comer]:
    """Vehicles that come from one side."""
    rng = np.random.default_rng(seed)
    ends = rng.uniform((-12.0, -2.0, 4.0), (-4.5, 2.0, 6.0), (count, 3))
    return [Comer(system, end, surface) for system, end in zip(range(11, 11 + count), ends, strict=True)]


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
    comers = drawn(seed, 5, CIRCLE)
    comers.append(Comer(99, np.array([-4.1, 0.0, 5.0]), CIRCLE))
    assert (places(comers)[99] == CIRCLE.nearest(comers[-1].end)).all()


def test_nobody_moves_whose_point_is_free() -> None:
    ends = [np.array([8.0 * np.cos(b), 8.0 * np.sin(b), 5.0]) for b in (0.0, 1.5, 3.0, 4.5)]
    comers = [Comer(system, end, CIRCLE) for system, end in enumerate(ends, 1)]
    for one, place in zip(comers, places(comers).values(), strict=True):
        assert (place == CIRCLE.nearest(one.end)).all()


def test_on_a_circle_the_next_place_touches_the_one_that_is_taken() -> None:
    taken = [Taken(np.array([-4.0, 0.0, 5.0]), REACH)]
    comer = Comer(11, np.array([-9.0, 0.1, 5.0]), CIRCLE)
    place = places([comer], taken)[11]
    assert np.linalg.norm(place - taken[0].place) == pytest.approx(REACH, abs=1e-6)
    assert place[1] > 0.0


def test_a_place_below_keeps_others_away_where_heights_do_not_count() -> None:
    comer = Comer(11, np.array([-9.0, 0.1, 5.0]), CIRCLE)
    for height, moved in ((1.0, False), (0.0, True)):
        place = places([comer], [Taken(np.array([-4.0, 0.0, 0.0]), REACH, height)])[11]
        assert (np.linalg.norm(place - CIRCLE.nearest(comer.end)) > 0.1) == moved


def test_without_room_and_above_the_target_the_nearest_point_remains() -> None:
    crowd = [Comer(system, np.array([-9.0, 0.01 * system, 5.0]), CIRCLE) for system in range(11, 40)]
    last = places(crowd)[39]
    assert (last == CIRCLE.nearest(crowd[-1].end)).all()
    top = Circle(radius=0.0, height=5.0)
    comers = [Comer(system, np.array([0.1 * system, 0.0, 9.0]), top) for system in (1, 2)]
    assert all((place == top.nearest(np.zeros(3))).all() for place in places(comers).values())


@pytest.mark.parametrize("assigns", [True, False])
def test_vehicles_that_come_from_one_side_share_a_circle(monkeypatch: Any, assigns: bool) -> None:
    target = np.array([8.0, 0.0, 0.0])
    angles = np.linspace(0.0, 2.0 * np.pi, 5, endpoint=False)[1:]
    starts = np.array([[-8.0 + 4.0 * np.cos(a), 4.0 * np.sin(a), 5.0] for a in angles])
    starts[:, 2] += 0.05 * np.arange(4)

    def around(place: Array, _target: Array | None) -> Aim:
        return Aim(target + CIRCLE.nearest(place - target), np.zeros(3), target, target, CIRCLE)

    monkeypatch.setattr("tests.companion.avoidance.certified.swarm.standing", around)
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
