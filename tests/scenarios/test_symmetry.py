"""Laws of whole flights: mirrored, turned, with vehicles exchanged they are flown alike.

Through bytes the mirror is as exact as the globe allows: degrees are rounded alike to both sides of a
meridian and of the equator, but the grid is 7 mm wide and 11 mm high, and the rolling moment of RotorS has no
mirror image. So a flight and its image are millimetres apart, and what is turned by a quarter centimetres.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from outrider.resources import config_root
from outrider.runs.ground_truth import Samples
from outrider.simulation.flight import Flight
from tests.scenarios.lockstep_flights import FIREFLY, scenario

Array = NDArray[np.float64]

AS_IT_IS, EAST_WEST, NORTH_SOUTH = np.eye(3), np.diag([-1.0, 1.0, 1.0]), np.diag([1.0, -1.0, 1.0])
QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
EQUATOR, ZURICH = 0.0, 47.397742
OTHER = {"own": "own", "right": "left"}
IN_ORDER, EXCHANGED = (0, 1, 2, 3), (2, 0, 3, 1)

CLOSE = 0.05
"""m, and of the direction in which a vehicle looks."""

PLACES = np.array([[4.0, 0.5, 5.0], [0.3, 4.2, 5.2], [-3.9, -0.6, 4.8], [-0.4, -3.8, 5.4]])
GOALS = PLACES * (-1.0, -1.0, 1.0) + (0.0, 0.0, 0.3)
PATH = np.array([[0.0, 0.0, 0.0], [4.0, 2.0, 0.0], [8.0, -2.0, 0.0], [4.0, -4.0, 0.0]])
POST = np.array([0.5, -0.4, 0.0])
"""In the way, but nobody starts or ends within its field: there not every method comes to rest."""


def _scene(matrix: Array, order: tuple[int, ...], methods: tuple[str, ...], sense: str) -> dict[str, Any]:
    """Four in the air beside a post, all in step: else who is exchanged plans at another time."""
    return {
        "vehicles": 4,
        "airborne": True,
        "cap_s": 5.0,
        "starts": {"kind": "points", "at": (PLACES @ matrix.T)[list(order)].tolist()},
        "obstacles": [{"kind": "post", "at": (matrix @ POST)[:2].tolist(), "radius": 0.3, "height": 20.0}],
        "clocks": {"offset_ms": 0.0, "drift_ppm": 0.0},
        "timing": {"base_tick_us": 10_000},
        "companion": {
            "methods": methods,
            "turning_sense": OTHER[sense] if np.linalg.det(matrix) < 0.0 else sense,
        },
    }


def _swap(matrix: Array, order: tuple[int, ...]) -> tuple[str, dict[str, Any]]:
    """Across the ring."""
    target = matrix @ (0.3, 0.2, 0.0)
    return "antipodal-8", {
        "task": "goto",
        "starts": {"goals": (GOALS @ matrix.T)[list(order)].tolist()},
        "target": {"kind": "fixed", "at": target.tolist()},
    }


def _orbit(matrix: Array, order: tuple[int, ...]) -> tuple[str, dict[str, Any]]:
    """Along with a target in bends, round which the ring turns."""
    rate = 0.2 * float(np.linalg.det(matrix))
    return "orbit", {"target": {"through": (PATH @ matrix.T).tolist()}, "companion": {"turn_rate": rate}}


TASKS = {"swap": _swap, "orbit": _orbit}


def fly(
    task: str,
    methods: tuple[str, ...],
    sense: str,
    matrix: Array = AS_IT_IS,
    order: tuple[int, ...] = IN_ORDER,
    latitude: float = ZURICH,
) -> Samples:
    name, changes = TASKS[task](matrix, order)
    place = {"origin": {"latitude": latitude}}
    flight = Flight(
        scenario(name, _scene(matrix, order, methods, sense), changes, place),
        FIREFLY,
        1,
        config_root() / "logs",
    )
    flight.run()
    assert flight.conductor.failure is None
    assert flight.conductor.clock_start is not None
    return flight.truth.samples(flight.conductor.clock_start)


@cache
def flown(task: str, methods: tuple[str, ...], sense: str, latitude: float = ZURICH) -> Samples:
    return fly(task, methods, sense, latitude=latitude)


def assert_alike(image: Samples, samples: Samples, matrix: Array) -> None:
    np.testing.assert_allclose(image.position, samples.position @ matrix.T, atol=CLOSE)
    looks, mirrored = (np.stack([np.cos(s.yaw), np.sin(s.yaw)], axis=-1) for s in (samples, image))
    np.testing.assert_allclose(mirrored, looks @ matrix[:2, :2].T, atol=CLOSE)


@pytest.mark.parametrize(
    ("methods", "sense"),
    [
        (("approach_angle",), "own"),
        (("tangential",), "own"),
        (("swivel", "tangential"), "own"),
    ],
)
def test_east_and_west_are_mirror_images(methods: tuple[str, ...], sense: str) -> None:
    samples = flown("swap", methods, sense)
    assert np.nanmin(samples.separation) < 2.0
    assert_alike(fly("swap", methods, sense, EAST_WEST), samples, EAST_WEST)


@pytest.mark.slow
def test_at_the_equator_so_are_north_and_south() -> None:
    methods, sense = ("swivel", "tangential"), "right"
    image = fly("orbit", methods, sense, NORTH_SOUTH, latitude=EQUATOR)
    assert_alike(image, flown("orbit", methods, sense, EQUATOR), NORTH_SOUTH)


@pytest.mark.slow
@pytest.mark.parametrize("task", TASKS)
def test_a_quarter_turned_it_is_the_same_flight(task: str) -> None:
    methods, sense = ("tangential",), "right"
    assert_alike(fly(task, methods, sense, QUARTER), flown(task, methods, sense), QUARTER)


@pytest.mark.parametrize("task", TASKS)
def test_exchanged_vehicles_exchange_their_flights(task: str) -> None:
    """Who has another system id is heard in another order, and its forces are summed in another."""
    methods, sense = ("tangential",), "right"
    exchanged, samples = fly(task, methods, sense, order=EXCHANGED), flown(task, methods, sense)
    np.testing.assert_allclose(exchanged.position, samples.position[:, list(EXCHANGED)], atol=1e-3)
    np.testing.assert_allclose(exchanged.velocity, samples.velocity[:, list(EXCHANGED)], atol=1e-2)
