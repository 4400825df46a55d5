"""Worlds of comparisons: obstacles as published, free starts and goals, ways, the same for a seed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from companion.config.obstacles import Box, Post, Sphere
from companion.config.planning import LimitsConfig
from companion.obstacles.static import FixedObstacles
from outrider.compare.cells import cells_of
from outrider.compare.comparison import Comparison
from outrider.compare.scene import Scene, scenario_of
from outrider.compare.world import Forest, Maze
from outrider.compare.worlds import drawn, folder_of
from outrider.errors import InputError
from outrider.resources import find
from outrider.scenarios.scenario import Scenario
from outrider.scenarios.starts import places
from outrider.scenarios.world_file import write_world
from outrider.yaml_files.yaml_file import load

SEEDS = (1, 2, 3)


def scene(name: str, row: int = 0, worlds: Path | None = None) -> Scene:
    path = find("comparisons", name)
    comparison = load(path, Comparison)
    (cell,) = cells_of(comparison, path, comparison.rows[row : row + 1], None, worlds)
    return Scene.model_validate_json(cell.document)


def boxes(scenario: Scenario) -> list[Box]:
    return [one for one in scenario.obstacles if isinstance(one, Box)]


def least(scenario: Scenario) -> float:
    """Distance of starts and goals from the nearest surface."""
    starts, goals = places(scenario)
    assert goals is not None
    return float(FixedObstacles(scenario.obstacles).distance(np.vstack([starts, goals])).min())


def ways(boxes: list[Box], cell: float) -> tuple[set[tuple[int, int]], tuple[int, int]]:
    """Open cells of a maze, and how many columns and rows it has."""
    centres = np.array([box.at[:2] for box in boxes])
    index = np.rint((centres - centres.min(axis=0)) / cell).astype(int)
    columns, rows = (index.max(axis=0) + 1).tolist()
    closed = {(x, y) for x, y in index.tolist()}
    return {(x, y) for x in range(columns) for y in range(rows)} - closed, (columns, rows)


@pytest.mark.parametrize(("row", "vehicles", "count", "within"), [(0, 10, 40, 4.75), (1, 20, 10, 3.0)])
def test_forests_have_the_published_boxes(row: int, vehicles: int, count: int, within: float) -> None:
    for seed in SEEDS:
        scenario = scenario_of(scene("lsc-forest", row), seed)
        found = boxes(scenario)
        assert (scenario.vehicles, len(found), len(scenario.obstacles)) == (vehicles, count, count)
        assert {box.size for box in found} == {(0.5, 0.5, 2.5)}
        assert np.abs([box.at[:2] for box in found]).max() <= within
        assert {box.at[2] for box in found} == {1.25}
        assert least(scenario) >= 0.31


@pytest.mark.parametrize(
    ("name", "cell", "size", "counts"), [("maze-sparse", 1.0, 6, (23, 24)), ("maze-dense", 0.5, 9, (48, 54))]
)
def test_mazes_have_the_published_cells_and_one_way_between_two_openings(
    name: str, cell: float, size: int, counts: tuple[int, int]
) -> None:
    for seed in SEEDS:
        scenario = scenario_of(scene(name), seed)
        found = boxes(scenario)
        assert counts[0] <= len(found) == len(scenario.obstacles) <= counts[1]
        assert {box.size for box in found} == {(cell, cell, 2.5)}
        opened, shape = ways(found, cell)
        assert shape == (size, size)
        assert [sum(x == side for x, _ in opened) for side in (0, size - 1)] == [1, 1]
        assert not any(y in (0, size - 1) for _, y in opened)
        # A tree: connected, and one neighbour fewer than cells.
        joined = sum(((x + 1, y) in opened) + ((x, y + 1) in opened) for x, y in opened)
        assert joined == len(opened) - 1
        reached, edge = set(), {next(iter(opened))}
        while edge:
            reached |= edge
            beside = {(x + i, y + j) for x, y in edge for i, j in ((1, 0), (-1, 0), (0, 1), (0, -1))}
            edge = (beside & opened) - reached
        assert reached == opened
        assert least(scenario) >= 0.31


def test_the_circle_of_hdsm_has_its_density_of_cylinders() -> None:
    scenario = scenario_of(scene("hdsm-circle"), 1)
    posts = [one for one in scenario.obstacles if isinstance(one, Post)]
    assert len(posts) == len(scenario.obstacles) == 90
    assert {post.radius for post in posts} == {0.15}
    assert np.abs([post.at for post in posts]).max() <= 15.0
    assert least(scenario) >= 0.6
    starts, _ = places(scenario)
    assert np.allclose(np.linalg.norm(starts[:, :2], axis=1), 22.0)


def test_the_exchange_of_ego_has_two_pillars_and_a_ring_apart() -> None:
    for seed in SEEDS:
        scenario = scenario_of(scene("ego-exchange"), seed)
        posts = [one for one in scenario.obstacles if isinstance(one, Post)]
        ring = [one for one in scenario.obstacles if isinstance(one, Sphere)]
        assert len(posts) + len(ring) == len(scenario.obstacles)
        assert len(posts) == 2
        assert all(0.5 <= post.radius <= 0.7 for post in posts)
        centres = np.array([one.at for one in ring])
        middle = centres.mean(axis=0)
        radii = np.linalg.norm(centres - middle, axis=1)
        assert np.allclose(radii, radii.mean(), atol=2e-3)
        assert 0.5 - 2e-3 <= radii.mean() <= 0.7 + 2e-3
        assert 0.7 - 2e-3 <= middle[2] <= 0.8 + 2e-3
        # Balls that follow each other touch: nothing flies through.
        gaps = np.linalg.norm(centres - np.roll(centres, 1, axis=0), axis=1)
        assert gaps.max() <= 0.1 + 2e-3
        axes = np.array([*(post.at for post in posts), middle[:2]])
        assert np.abs(axes).max() <= 2.0 + 2e-3
        assert min(np.linalg.norm(axes[i] - axes[j]) for i, j in ((0, 1), (0, 2), (1, 2))) >= 0.8 - 2e-3


@pytest.mark.parametrize("name", ["lsc-forest", "maze-dense", "hdsm-circle", "ego-exchange"])
def test_a_seed_draws_the_same_world_and_another_seed_another(name: str) -> None:
    of = scene(name)
    first, again, other = (scenario_of(of, seed).obstacles for seed in (1, 1, 2))
    assert first == again
    assert first != other


def test_a_world_without_a_way_is_drawn_again_and_refused_in_the_end() -> None:
    starts, goals = np.array([[-2.0, 0.0, 1.0]]), np.array([[2.0, 0.0, 1.0]])
    limits = LimitsConfig(box_min=(-2.5, -0.6, 0.5), box_max=(2.5, 0.6, 2.0))
    world = Forest(
        kind="forest",
        count=1,
        size=(0.4, 2.0, 2.0),
        low=(-1.0, -1.5),
        high=(1.0, 1.5),
        clear=0.2,
        passable=0.2,
    )
    # Between a box whose centre is 0.6 m aside and the side of the limits there are 0.2 m for centres.
    aside = [abs(drawn(world, starts, goals, limits, seed)[0].at[1]) for seed in range(8)]
    assert min(aside) >= 0.6
    wide = world.model_copy(update={"size": (0.4, 5.0, 2.0)})
    with pytest.raises(InputError, match="seed 4: none of 200 worlds"):
        drawn(wide, starts, goals, limits, 4)
    full = Maze(kind="maze", columns=6, rows=6, cell=1.0, first=(0.0, 0.0), height=2.0, closed=(34, 36))
    with pytest.raises(InputError, match=r"none of 200 worlds \(maze\)"):
        drawn(full, starts, goals, limits, 4)


def test_world_files_are_flown_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    for number in (10, 2):
        box = Box(kind="box", at=(0.0, 0.25 * number, 1.0), size=(0.5, 0.5, 2.0))
        write_world(tmp_path / f"maze{number}.csv", [box])
    assert [(name, len(world)) for name, world in folder_of(tmp_path).items()] == [
        ("maze2.csv", 1),
        ("maze10.csv", 1),
    ]
    of = scene("maze-sparse", worlds=tmp_path)
    assert [scenario_of(of, seed).obstacles[0].at[1] for seed in SEEDS] == [0.5, 2.5, 0.5]
    (tmp_path / "maze3.csv").write_text("1,2,3,4,nan,6\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"maze3\.csv:1:9: sy is nan"):
        folder_of(tmp_path)
