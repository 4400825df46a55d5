"""Faults of a link by direction: what a scenario says of one way does not touch another."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from mavlink_bridge.network.simulated import Faults, SimulatedNetwork
from outrider.scenarios.links import Links
from outrider.simulation.fleet import Fleet
from tests.outrider.shipped import FIREFLY, LOGS, scenario

COMPANION, AUTOPILOT = ("companion", 11), ("autopilot", 11)


def links(*directions: dict[str, Any], **own: Any) -> Links:
    return Links.model_validate({"directions": directions, **own})


def test_without_directions_both_ways_are_alike() -> None:
    both = links(delay_ms=12.5, jitter_ms=3.0, loss=0.1, duplication=0.2, reordering=0.3)
    assert both.between(COMPANION, AUTOPILOT) == both.between(AUTOPILOT, COMPANION) == both.faults
    assert both.faults == Faults(12_500, 3_000, 0.1, 0.2, 0.3)


@given(st.sampled_from(["companion", 11, None]), st.floats(0.0, 1.0))
def test_one_way_leaves_the_other_as_it_is(sender: str | int | None, loss: float) -> None:
    one = links({"sender": sender, "receiver": "autopilot", "loss": loss}, delay_ms=5.0)
    assert one.between(COMPANION, AUTOPILOT) == one.faults._replace(loss=loss)
    assert one.between(AUTOPILOT, COMPANION) == one.faults


def test_the_last_that_fits_counts_and_leaves_what_it_does_not_say() -> None:
    several = links({"loss": 0.5, "delay_ms": 7.0}, {"sender": 12, "loss": 0.9}, {"sender": 13, "loss": 0.0})
    assert several.between(("companion", 12), ("companion", 11)) == Faults(7_000, 0, 0.9, 0.0, 0.0)
    assert several.between(("companion", 14), ("companion", 11)) == Faults(7_000, 0, 0.5, 0.0, 0.0)


def test_a_fleet_s_channels_carry_them() -> None:
    swarm = {"directions": [{"sender": 11, "receiver": 12, "loss": 1.0}]}
    autopilot = {"directions": [{"sender": "autopilot", "loss": 0.25}]}
    of = scenario("antipodal-8", vehicles=3, links={"swarm": swarm, "autopilot": autopilot})
    channels = {channel.name: channel for channel in Fleet(of, FIREFLY, 1, LOGS).channels()}
    assert set(channels["swarm"].overrides) == {("companion-11", "companion-12")}
    assert channels["swarm"].overrides["companion-11", "companion-12"].loss == 1.0
    for system in of.systems:
        overrides = channels[f"autopilot-companion-{system}"].overrides
        assert {pair: faults.loss for pair, faults in overrides.items()} == {
            (f"sitl-{system}", f"companion-{system}"): 0.25
        }
    assert not channels["target-companion-11"].overrides


@pytest.mark.parametrize("name", [10, 14, "compagnon", "sitl-11"])
def test_who_is_not_there_is_refused(name: str | int) -> None:
    with pytest.raises(ValueError, match="is neither a vehicle"):
        scenario("antipodal-8", vehicles=3, links={"swarm": {"directions": [{"sender": name}]}})


@pytest.mark.parametrize(
    ("said", "least"),
    [
        ({"burst": 0.5}, "1 "),
        ({"loss": 0.8, "burst": 2.0}, "4 "),
        ({"burst": 2.0, "directions": [{"sender": 12, "loss": 0.5}, {"receiver": 13, "loss": 0.9}]}, "9 "),
    ],
)
def test_a_burst_too_short_for_its_loss_is_refused(said: dict[str, Any], least: str) -> None:
    """As it is read: the ether would refuse it when a run directory is there already."""
    with pytest.raises(ValidationError, match=f"allowed: 0, or {least}"):
        Links.model_validate(said)


def test_a_burst_just_long_enough_flies() -> None:
    flown = scenario("antipodal-8", links={"swarm": {"loss": 0.8, "burst": 4.0}})
    assert SimulatedNetwork(Fleet(flown, FIREFLY, 1, LOGS).channels(), 1, 2_500).counters.sent == 0
