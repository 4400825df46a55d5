"""Flights that begin and end in the air: the companion takes over a vehicle that flies, and tells it neither
to arm nor to take off nor to land."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as mavlink

from companion.values.components import COMPONENT
from companion.values.phase import Phase
from mavlink_bridge.messages import CommandInt, CommandLong
from outrider.runs.names import LINK_NUMBERS
from outrider.runs.summary import exit_status
from outrider.simulation.flight import EPOCH
from sitl.autopilot.firmware import Mode
from tests.scenarios.flight_facts import check_told, clock, log
from tests.scenarios.lockstep_flights import Flown, check, fly, scenario, setpoints

PAIR: dict[str, Any] = {
    "vehicles": 2,
    "airborne": True,
    "task": "goto",
    "starts": {
        "kind": "points",
        "at": [[-2.0, 0.0, 5.0], [2.0, 0.0, 6.5]],
        "goals": [[-2.0, 2.0, 5.0], [2.0, 2.0, 6.0]],
        "jitter": 0.2,
    },
}
ROUGH: dict[str, Any] = {"sensors": "rtk", "weather": {"wind": [6.0, 0.0, 0.0], "turbulence": "light"}}
FLAVOURS = ("ardupilot", "px4")


def ordered(flown: Flown, system: int) -> list[int]:
    """Commands that the companion of ``system`` gave its autopilot."""
    found = []
    for received in log(flown, system):
        message = received.message
        if received.link == LINK_NUMBERS["autopilot"] and isinstance(message, CommandInt | CommandLong):
            assert (message.source.system, message.source.component) == (system, COMPONENT)
            found.append(message.command)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("flavour", FLAVOURS)
@pytest.mark.parametrize("world", [{}, ROUGH], ids=["calm", "rough"])
def test_it_begins_and_ends_in_the_air(flavour: str, world: dict[str, Any], tmp_path: Path) -> None:
    flown = fly(scenario("antipodal-8", PAIR, world, {"flavour": flavour}), 2, tmp_path)
    check_told(flown)
    flight = flown.flight
    start = flight.conductor.clock_start
    assert start is not None
    assert start - EPOCH <= 2_000_000
    everything, (samples, _) = flight.truth.samples(), clock(flown)
    assert np.linalg.norm(everything.position[0] - flight.fleet.starts.positions, axis=1).max() < 0.05
    # Nobody is let fall before the companion steers, wind or not.
    held = everything.position[everything.time < start] - flight.fleet.starts.positions
    assert np.linalg.norm(held, axis=-1).max() < 0.5
    assert everything.position[..., 2].min() > 4.0
    assert flown.summary["converged"] is True
    assert exit_status(flown.summary) == 0
    assert np.linalg.norm(samples.velocity[-1], axis=1).max() < 0.3
    for autopilot, companion in zip(flight.autopilots, flight.companions, strict=True):
        assert (autopilot.airborne, autopilot.armed, autopilot.mode) == (True, True, Mode.GUIDED)
        assert companion.pilot.phase is Phase.ESCORT
        assert not companion.pilot.commands.refusals or flavour == "px4"
    for system, path in zip(flight.systems, flown.logs, strict=True):
        orders = set(ordered(flown, system))
        assert not orders & {
            mavlink.MAV_CMD_NAV_TAKEOFF,
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM,
            mavlink.MAV_CMD_NAV_LAND,
        }
        # ArduPilot hovers in GUIDED; PX4 holds, and must be asked for OFFBOARD.
        assert (mavlink.MAV_CMD_DO_SET_MODE in orders) is (flavour == "px4")
        assert len(setpoints(path)) > 100


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_from_the_ground_all_of_that_is_ordered(flavour: str, tmp_path: Path) -> None:
    """The same flight from the ground: what the test above does not find is found here."""
    flown = fly(
        scenario("antipodal-8", PAIR, {"flavour": flavour, "airborne": False, "cap_s": 1.0}), 2, tmp_path
    )
    check(flown)
    for system in flown.flight.systems:
        assert {
            mavlink.MAV_CMD_NAV_TAKEOFF,
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM,
            mavlink.MAV_CMD_NAV_LAND,
            mavlink.MAV_CMD_DO_SET_MODE,
        } <= set(ordered(flown, system))


def test_in_the_air_without_a_goal_it_ends_with_the_cap(tmp_path: Path) -> None:
    """An escort of a target that stays has no goal event: flown for as long as the cap says."""
    of = scenario(
        "scenario-1",
        {"vehicles": 2, "airborne": True, "cap_s": 2.0, "target": {"at": [0.0, 0.0, 0.0], "jump_to": None}},
        {"starts": {"centre": [0.0, 0.0]}},
    )
    flown = fly(of, 1, tmp_path)
    check_told(flown)
    conductor = flown.flight.conductor
    assert conductor.clock_start is not None
    assert conductor.clock_end == conductor.clock_start + 2_000_000
    assert flown.summary["converged"] is None
    assert flown.summary["convergence_time_s"] is None
    assert exit_status(flown.summary) == 0
    assert all(autopilot.airborne for autopilot in flown.flight.autopilots)
