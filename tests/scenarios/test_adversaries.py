"""A neighbour, forged or innocent, presses no vehicle out of its box and makes none faster than v_max: limits
come before the field."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.scenarios.adversary import ADVERSARIES, Pressed, descending, press, shipped
from tests.scenarios.single_vehicle import SITE, SingleVehicle

PLAIN: dict[str, Any] = {"rates": {"replan_us": 50_000}}
SETTINGS: dict[str, dict[str, Any]] = {
    "plain": PLAIN,
    "slow": {**PLAIN, "limits": {"v_max": [2.0, 2.0, 1.0]}},
    **{
        flavour: {**shipped(flavour), "task": "goto", "formation": {"kind": "nearest"}}
        for flavour in ("ardupilot", "px4")
    },
}
FLIGHTS = [
    ("plain", "ardupilot", "exact"),
    ("slow", "ardupilot", "exact"),
    *[(flavour, flavour, response) for flavour in ("ardupilot", "px4") for response in ("exact", "firmware")],
]
LEVEL = np.array([1.0, 1.0, 0.0])
SEEDS = [pytest.param(seed, marks=pytest.mark.soak if seed > 8 else ()) for seed in range(1, 21)]


def flown(settings: str, flavour: str, response: str, floor: float, height: float = 8.0) -> SingleVehicle:
    limits = {**SETTINGS[settings].get("limits", {}), "box_min": [-20.0, -20.0, floor]}
    vehicle = SingleVehicle(flavour, {**SETTINGS[settings], "limits": limits}, response=response)
    vehicle.fly(height)
    return vehicle


def check(vehicle: SingleVehicle, pressed: Pressed) -> None:
    """No set-point leaves the box or is faster than v_max on any axis, and no vehicle sinks below the floor.
    The other walls it may pass by a decimetre: it follows its set-points no better."""
    limits = vehicle.config.limits
    low, high = np.array(limits.box_min), np.array(limits.box_max)
    assert len(pressed.asked) > 400
    assert (pressed.asked >= low).all()
    assert (pressed.asked <= high).all()
    assert (np.abs(pressed.speeds) <= np.array(limits.v_max) + 1e-6).all()
    assert pressed.places[:, 2].min() >= low[2]
    assert (pressed.places >= low - 0.1).all()
    assert (pressed.places <= high + 0.1).all()


@pytest.mark.slow
@pytest.mark.parametrize(("settings", "flavour", "response"), FLIGHTS)
@pytest.mark.parametrize("seed", SEEDS)
def test_no_neighbour_presses_it_out_of_its_box(settings, flavour, response, seed):
    vehicle = flown(settings, flavour, response, 6.0)
    names = list(ADVERSARIES)
    name = names[(seed + FLIGHTS.index((settings, flavour, response))) % len(names)]
    pressed = press(vehicle, ADVERSARIES[name], 10.0, seed)
    check(vehicle, pressed)
    if name == "above":
        # It was pressed as far as that goes: the test would notice a floor that gives way.
        assert pressed.places[:, 2].min() < vehicle.config.limits.box_min[2] + 1.0


@pytest.mark.parametrize(("settings", "flavour", "response"), FLIGHTS)
def test_one_that_comes_down_on_it_is_evaded_sideways_and_not_through_the_floor(settings, flavour, response):
    """It comes down exactly on a vehicle that keeps its place 2 m above the floor, and stays there."""
    vehicle = flown(settings, flavour, response, 3.0, 5.0)
    start = vehicle.place

    def above(time: float, victim: np.ndarray, chance: np.random.Generator) -> np.ndarray:
        return descending(time, victim, chance) + start * LEVEL

    pressed = press(vehicle, above, 15.0, 1)
    check(vehicle, pressed)
    times, chance = 0.01 * np.arange(len(pressed.places)), np.random.default_rng(1)
    others = np.array([above(time, start, chance) for time in times])
    distances = np.linalg.norm(pressed.places - others, axis=1)
    assert distances.min() > vehicle.config.field.d_min
    assert pressed.places[:, 2].min() < 5.0 - 0.5


@pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
def test_a_forged_neighbour_above_it_presses_a_shipped_companion_not_to_the_ground(flavour):
    vehicle = flown(flavour, flavour, "firmware", 2.5, 5.0)
    pressed = press(vehicle, ADVERSARIES["above"], 20.0, 1)
    check(vehicle, pressed)
    assert pressed.speeds[:, 2].min() >= -vehicle.config.limits.v_max[2]


@pytest.mark.parametrize(
    ("name", "flavour"),
    [
        ("above", "px4"),
        *[
            pytest.param(name, "ardupilot", marks=pytest.mark.slow)
            for name in ("above", "circling", "jumping")
        ],
    ],
)
def test_the_height_above_the_take_off_is_a_floor_like_the_boxs(name, flavour):
    """It takes off 8 m above the fleet's zero: the box's floor at 2.5 m is below the ground there."""
    settings = {**SETTINGS[flavour], "limits": {"box_min": [-20.0, -20.0, 2.5]}}
    settings["limits"] = {**SETTINGS[flavour]["limits"], **settings["limits"]}
    settings["guard"] = {**SETTINGS[flavour]["guard"], "least_height": 3.0}
    vehicle = SingleVehicle(flavour, settings, response="firmware", altitude=SITE.altitude + 8.0)
    vehicle.fly(5.0)
    pressed = press(vehicle, ADVERSARIES[name], 8.0, 1)
    assert len(pressed.asked) > 350
    floor = vehicle.companion.pilot.start[2] + 3.0
    assert floor > 10.5
    assert pressed.asked[:, 2].min() >= floor
    assert pressed.places[:, 2].min() >= floor
    if name == "above":
        assert pressed.places[:, 2].min() < floor + 1.0
