"""Random scenes: every draw is a scenario with room between its places, and the dial turns one way."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.config.obstacles import Box
from companion.obstacles.static import FixedObstacles
from outrider.errors import InputError
from outrider.resources import config_root
from outrider.scenarios.places import FixedTarget, Points
from outrider.scenarios.scenario import Scenario
from outrider.sweep.draw import draw, scene_parameters, vehicles
from outrider.sweep.scenes import DECIDED, Scene
from outrider.yaml_files.yaml_file import load, read
from sitl.estimation.profiles import PROFILES

SHIPPED = {path.stem: path for path in sorted((config_root() / "scenes").glob("*.yaml"))}
SEEDS = st.integers(0, 2**31)


def scene(name: str = "clutter", **changes: Any) -> Scene:
    base = load(SHIPPED[name], Scene).model_dump(mode="json")
    return Scene.model_validate_json(json.dumps({**base, **changes}), strict=True)


def drawn(which: Scene, seed: int) -> Scenario:
    return Scenario.model_validate_json(json.dumps(draw(which, seed)), strict=True)


def spans(low: float, high: float) -> st.SearchStrategy[list[float]]:
    return st.tuples(st.floats(low, high), st.floats(low, high)).map(lambda pair: sorted(pair))


def dial(low: float, high: float) -> st.SearchStrategy[dict[str, float]]:
    return spans(low, high).map(lambda pair: {"easy": pair[0], "hard": pair[1]})


SCENES = st.builds(
    scene,
    name=st.sampled_from(sorted(SHIPPED)),
    vehicles=st.tuples(st.integers(2, 12), st.integers(2, 12)).map(sorted),
    difficulty=st.floats(0.0, 1.0),
    density=dial(0.05, 2.0),
    speed=dial(0.5, 9.0),
    height=spans(1.0, 20.0),
    apart=st.floats(1.0, 5.0),
    clear=st.floats(0.0, 3.5),
    gap=st.floats(0.0, 3.0),
    spheres=st.none() | st.fixed_dictionaries({"per_vehicle": dial(0.0, 1.0), "radius": spans(0.1, 2.0)}),
    posts=st.none()
    | st.fixed_dictionaries({"per_vehicle": dial(0.0, 1.0), "radius": spans(0.1, 1.0)})
    | st.fixed_dictionaries({"count": st.tuples(st.integers(0, 6), st.integers(0, 6)).map(sorted)}),
    boxes=st.none() | st.fixed_dictionaries({"per_vehicle": dial(0.0, 1.0), "size": spans(0.2, 3.0)}),
)


def nearest(places: np.ndarray) -> float:
    """Least distance between two of them, seen from above."""
    off = np.linalg.norm(places[:, None, :2] - places[None, :, :2], axis=-1)
    return float(off[np.triu_indices(len(places), 1)].min())


@pytest.mark.parametrize("name", sorted(SHIPPED))
def test_a_shipped_scene_draws_at_every_difficulty(name: str) -> None:
    for difficulty in (0.0, 0.5, 1.0):
        which = scene(name, difficulty=difficulty)
        fleets = {drawn(which, seed).vehicles for seed in range(1, 21)}
        assert min(fleets) >= which.vehicles[0]
        assert max(fleets) <= which.vehicles[1]
        assert len(fleets) > 1


@settings(max_examples=40)
@given(SCENES, SEEDS)
def test_places_keep_apart_and_clear(which: Scene, seed: int) -> None:
    try:
        flown = drawn(which, seed)
    except InputError as error:
        said = str(error)
    else:
        said = None
    if said is not None:
        assert "finds no place" in said
        assert "allowed: " in said
        return
    assert isinstance(flown.starts, Points)
    assert isinstance(flown.target, FixedTarget)
    starts = np.array(flown.starts.at)
    assert len(starts) == flown.vehicles == vehicles(which, seed)
    assert nearest(starts) >= which.apart
    places = starts
    if flown.starts.goals is not None:
        goals = np.array(flown.starts.goals)
        assert nearest(goals) >= which.apart
        places = np.vstack([starts, goals])
    assert (places[:, 2] >= which.height[0] - 1e-3).all()
    assert (places[:, 2] <= which.height[1] + 1e-3).all()
    if flown.obstacles:
        # The companion's own geometry, from any height: seen from above is the least.
        assert FixedObstacles(flown.obstacles).distance(places).min() >= which.clear - 1e-9
        across = np.array([o.at[:2] for o in flown.obstacles])
        radii = np.array(
            [0.5 * np.hypot(*o.size[:2]) if isinstance(o, Box) else o.radius for o in flown.obstacles]
        )
        off = np.linalg.norm(across[:, None] - across[None], axis=-1) - radii[:, None] - radii[None]
        np.fill_diagonal(off, np.inf)
        assert off.min() >= which.gap - 1e-9
    low, high = np.array(flown.companion.limits.box_min), np.array(flown.companion.limits.box_max)
    assert (places > low).all()
    assert (places < high).all()


def test_boxes_leave_the_other_obstacles_of_a_seed_as_they_are_and_stand_on_the_ground() -> None:
    plain = drawn(scene("clutter"), 3).obstacles
    blocks = {"count": [4, 4], "size": [0.5, 1.0], "height": [2.0, 3.0]}
    found = drawn(scene("clutter", boxes=blocks), 3).obstacles
    assert found[: len(plain)] == plain
    boxes = [one for one in found[len(plain) :] if isinstance(one, Box)]
    assert len(boxes) == 4 == len(found) - len(plain)
    for one in boxes:
        assert one.at[2] == 0.5 * one.size[2]
        assert 0.5 <= min(one.size[:2]) <= max(one.size[:2]) <= 1.0
        assert 2.0 <= one.size[2] <= 3.0
    assert len({one.yaw_deg for one in boxes}) == 4


@settings(max_examples=40)
@given(st.integers(2, 12), st.floats(0.0, 1.0), SEEDS)
def test_an_escort_s_circles_are_clear_and_its_jumps_as_long_as_it_says(
    count: int, difficulty: float, seed: int
) -> None:
    which = scene("chase", vehicles=[count, count], difficulty=difficulty)
    flown = drawn(which, seed)
    assert isinstance(flown.target, FixedTarget)
    wanted = scene_parameters(which, count, seed)
    places = np.array([flown.target.at, *(jump.to for jump in flown.target.jumps)])
    assert len(flown.target.jumps) == wanted.jumps
    np.testing.assert_allclose(np.linalg.norm(np.diff(places, axis=0), axis=1), wanted.length, atol=2e-3)
    times = [jump.after_s for jump in flown.target.jumps]
    assert times == pytest.approx([k * wanted.every_s for k in range(wanted.jumps)], abs=2e-3)
    assert flown.cap_s > times[-1] + 30.0
    radius = flown.companion.surface.radius
    # Whoever keeps to the circle has room for himself.
    assert 2.0 * np.pi * radius / count >= which.apart - 1e-2
    for obstacle in flown.obstacles:
        off = np.linalg.norm(places[:, :2] - np.array(obstacle.at[:2]), axis=1)
        assert (np.abs(off - radius) - obstacle.radius >= which.clear - 1e-9).all()


@settings(max_examples=30)
@given(st.sampled_from(sorted(SHIPPED)), SEEDS)
def test_a_seed_is_one_scenario_and_another_seed_another(name: str, seed: int) -> None:
    which = scene(name)
    assert draw(which, seed) == draw(scene(name), seed)
    assert draw(which, seed) != draw(which, seed + 1)


@given(SCENES, st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.integers(2, 200), SEEDS)
def test_the_dial_turns_one_way(which: Scene, one: float, other: float, count: int, seed: int) -> None:
    easy, hard = (
        scene_parameters(which.model_copy(update={"difficulty": difficulty}), count, seed)
        for difficulty in sorted((one, other))
    )
    assert hard.half <= easy.half
    assert hard.speed >= easy.speed
    assert hard.spheres >= easy.spheres
    assert hard.posts >= easy.posts
    assert hard.boxes >= easy.boxes
    assert hard.jumps >= easy.jumps
    assert hard.length >= easy.length
    assert hard.every_s <= easy.every_s


def test_numbers_in_all_are_drawn_evenly_whatever_the_dial() -> None:
    found = [
        [scene_parameters(scene("posts", difficulty=difficulty), count, seed).posts for seed in range(700)]
        for difficulty, count in ((0.0, 3), (1.0, 10))
    ]
    assert found[0] == found[1]
    # Each of seven numbers a hundred times, with a standard deviation of nine.
    assert all(55 <= found[0].count(number) <= 145 for number in range(7))


@settings(max_examples=30)
@given(st.floats(0.0, 1.0), SEEDS)
def test_the_dial_does_not_change_who_flies(difficulty: float, seed: int) -> None:
    assert vehicles(scene(difficulty=difficulty), seed) == vehicles(scene(difficulty=0.5), seed)


def test_the_ends_of_the_dial_are_those_of_the_file() -> None:
    which = scene("chase")
    easy, hard = (scene_parameters(which.model_copy(update={"difficulty": d}), 8, 1) for d in (0.0, 1.0))
    assert which.jumps is not None
    assert 100 * 8 / (2 * easy.half) ** 2 == pytest.approx(which.density.easy)
    assert 100 * 8 / (2 * hard.half) ** 2 == pytest.approx(which.density.hard)
    assert (easy.speed, hard.speed) == (which.speed.easy, which.speed.hard)
    assert (easy.jumps, hard.jumps) == (which.jumps.count.easy, which.jumps.count.hard)
    assert (easy.every_s, hard.every_s) == (which.jumps.every_s.easy, which.jumps.every_s.hard)


def test_two_hundred_vehicles_find_room() -> None:
    flown = drawn(scene("crossing", vehicles=[200, 200], difficulty=1.0), 3)
    assert flown.vehicles == 200
    assert isinstance(flown.starts, Points)
    assert nearest(np.array(flown.starts.at)) >= 4.0


def test_the_rest_of_the_scenario_is_the_file_s() -> None:
    which = scene(
        scenario={
            "sensors": "rtk",
            "companion": {"planar": True},
            "links": {"swarm": {"loss": 0.2}},
            "cap_s": 9.0,
        }
    )
    flown = drawn(which, 1)
    assert (flown.sensors, flown.companion.planar, flown.links.swarm.loss, flown.cap_s) == (
        "rtk",
        True,
        0.2,
        9.0,
    )
    assert flown.companion.task == "goto"


# What cannot be


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"density": {"easy": 4.0, "hard": 4.0}, "vehicles": [60, 60], "apart": 6.0}, "start"),
        ({"posts": {"per_vehicle": {"easy": 30, "hard": 30}}, "vehicles": [8, 8]}, "post"),
        ({"clear": 50.0}, "sphere 1 of"),
        ({"boxes": {"count": [30, 30], "size": [9.0, 9.0]}, "vehicles": [2, 2]}, "box"),
    ],
)
def test_what_cannot_be_placed_is_refused_with_a_sentence(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError) as caught:
        draw(scene(**changes), 5)
    text = str(caught.value)
    assert text.startswith("scene 'clutter', seed 5: ")
    assert f"{said} " in text
    assert "finds no place" in text
    assert "; allowed: " in text


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("difficulty: 1.5\n", "difficulty is 1.5"),
        ("vehicles: [2, 300]\n", "vehicles[1] is 300"),
        ("vehicles: [9, 3]\n", "vehicles: the second must not be less"),
        ("speed: {easy: 5.0, hard: 2.0}\n", "speed: hard must not be less than easy"),
        ("difficultly: 0.5\n", "did you mean 'difficulty'?"),
        ("task: escort\n", "needs them"),
        ("posts: {per_vehicle: {easy: 0.0, hard: 1.0}, raidus: [1.0, 1.0]}\n", "did you mean 'radius'?"),
        ("posts: {per_vehicle: {easy: 0.0, hard: 1.0}, radius: [2.0, 1.0]}\n", "posts.radius: the second"),
        ("posts: {count: [2, 1]}\n", "posts.count: the second"),
        ("boxes: {count: [0, 1], size: [2.0, 1.0]}\n", "boxes.size: the second"),
        ("posts: {radius: [0.2, 0.6]}\n", "per_vehicle or count"),
        ("posts: {count: [0, 1], per_vehicle: {easy: 0.0, hard: 1.0}}\n", "per_vehicle or count"),
    ],
)
def test_what_is_wrong_with_a_file_is_said(change: str, said: str) -> None:
    keys = {
        "name": "a",
        "task": "goto",
        "vehicles": "[2, 3]",
        "density": "{easy: 1.0, hard: 1.0}",
        "speed": "{easy: 1.0, hard: 1.0}",
    }
    key, _, value = change.strip().partition(": ")
    text = "".join(f"{name}: {word}\n" for name, word in {**keys, key: value}.items())
    with pytest.raises(InputError) as caught:
        read(text.encode(), "scene.yaml", Scene)
    assert said in str(caught.value)
    assert "scene.yaml:" in str(caught.value)


@pytest.mark.parametrize("key", DECIDED)
@pytest.mark.parametrize("dotted", [True, False])
def test_what_the_scene_decides_cannot_be_given(key: str, dotted: bool) -> None:
    document: Any = 1
    for part in [key] if dotted else reversed(key.split(".")):
        document = {part: document}
    with pytest.raises(ValueError, match=f"scenario: {key} is for the scene to decide"):
        scene(scenario=document)


def struck(seed: int, **trouble: Any) -> dict[str, Any]:
    """What ``draw`` gives for ``certified-fuzz`` with some of its troubles changed."""
    base = load(SHIPPED["certified-fuzz"], Scene).model_dump(mode="json")["trouble"]
    return draw(scene("certified-fuzz", trouble={**base, **trouble}), seed)


NEITHER: dict[str, Any] = {"gusts": [0, 0], "jumps": [0, 0]}


def test_gusts_and_jumps_are_as_many_and_as_strong_as_the_scene_allows_and_change_nothing_else() -> None:
    gusts, jumps = set(), set()
    for seed in range(1, 41):
        document, without = (struck(seed, restarts=[0, 0], **few) for few in ({}, NEITHER))
        sigma = PROFILES[document["sensors"]].worst_axis
        blown = document["weather"].pop("gusts")
        jumped = [fault for fault in document["faults"] if fault["kind"] == "gps_jump"]
        assert all(np.linalg.norm(gust["velocity"]) <= 8.001 for gust in blown)
        assert all(np.linalg.norm(fault["offset"]) <= 1.5 * sigma + 1e-3 for fault in jumped)
        assert len({fault["vehicle"] for fault in jumped}) == len(jumped)
        document["faults"] = [fault for fault in document["faults"] if fault not in jumped]
        assert document == without
        gusts.add(len(blown))
        jumps.add(len(jumped))
    assert gusts == jumps == {0, 1, 2}


def test_silent_ends_cut_off_those_that_vanish_and_change_nothing_else() -> None:
    ended = 0
    for seed in range(1, 31):
        document, without = struck(seed, silent=True), struck(seed)
        vanished = {
            fault["vehicle"]: fault["at_s"] for fault in document["faults"] if fault["kind"] == "vanish"
        }
        for system, at_s in vanished.items():
            (cut,) = [one for one in document["partitions"] if one["members"] == [system]]
            assert cut["at_s"] == at_s
            assert at_s + cut["for_s"] > document["cap_s"]
        others = [
            [cut for cut in one["partitions"] if len(cut["members"]) > 1] for one in (document, without)
        ]
        assert others[0] == others[1]
        assert {**document, "partitions": []} == {**without, "partitions": []}
        ended += len(vanished)
    assert ended > 5


def test_restarts_are_those_of_companions_that_neither_hang_nor_vanish_and_change_nothing_else() -> None:
    numbers = set()
    for seed in range(1, 31):
        document, without = struck(seed, restarts=[0, 2]), struck(seed, restarts=[0, 0])
        restarts = [fault for fault in document["faults"] if fault["kind"] == "restart"]
        others = [fault for fault in document["faults"] if fault["kind"] != "restart"]
        silent = {fault["vehicle"] for fault in others if fault["kind"] in ("freeze", "vanish")}
        assert silent.isdisjoint(fault["vehicle"] for fault in restarts)
        assert {**document, "faults": others} == without
        numbers.add(len(restarts))
    assert numbers == {0, 1, 2}
