"""Flights alone: after a go, one after another, while all others are disarmed; without it nothing arms."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as mavlink

from companion.config import CompanionConfig
from mavlink_bridge.messages import CommandLong, Source
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec
from outrider.preflight.course import Box
from outrider.preflight.findings import Result
from outrider.preflight.own_checks import own_checks
from outrider.preflight.terms import FlightTerms, Phase
from sitl.node import LINK
from tests.outrider.preflight.bench import SECOND, Fleet, companion, failed, found

EAST = FlightTerms(100, 4.0, Box(8.0, 0.0, 0.0), go=True)
"""Only one edge there and back."""
WIDE: dict[str, Any] = {"box_min": [-30.0, -30.0, 2.5], "box_max": [30.0, 30.0, 20.0]}


def settings(*systems: int, **limits: Any) -> CompanionConfig:
    return companion(
        certified={"fleet": list(systems)},
        limits={**WIDE, "j_max": [3.5, 3.5, 3.5], **limits},
        tracking={"compensate": True},
    )


def fleet(
    systems: tuple[int, ...] = (1, 3),
    fly: FlightTerms | dict[int, FlightTerms] = EAST,
    wait_s: float = 5.0,
    **changes: Any,
) -> Fleet:
    """Vehicles with the response of their firmware; all but 2 are ArduCopters."""
    given: dict[str, Any] = {
        "configs": dict.fromkeys(systems, settings(*systems)),
        "autopilots": {system: {"response": "firmware"} for system in systems},
        "fly": fly if isinstance(fly, dict) else dict.fromkeys(systems, fly),
    }
    return Fleet(present=systems, wait_s=wait_s, **{**given, **changes})


class Airborne:
    """Looks on: which vehicles were armed, in the order of their arming, and where they were."""

    def __init__(self, watched: Fleet) -> None:
        self._fleet = watched
        self.order: list[int] = []
        self.most = 0

    def __call__(self, _now: int) -> bool:
        armed = [system for system, one in self._fleet.autopilots.items() if one.armed]
        self.order += [system for system in armed if system not in self.order]
        self.most = max(self.most, len(armed))
        return all(node.over for node in self._fleet.nodes.values())


def run(of: Fleet, seconds: float = 300.0) -> Airborne:
    seen = Airborne(of)
    of.loop.run(round(seconds * SECOND), seen)
    return seen


@pytest.mark.slow
def test_they_fly_one_after_another_and_the_largest_tube_is_the_fleets() -> None:
    flying = fleet((1, 2), FlightTerms(100, 5.0, Box(), go=True))
    seen = run(flying)
    assert (seen.order, seen.most) == ([1, 2], 1)
    verdicts = [node.verdict() for node in flying.nodes.values()]
    assert [failed(verdict) for verdict in verdicts] == [set(), set()]
    one, two = (verdict.fleet for verdict in verdicts)
    assert one == two
    assert one is not None
    results = [node.turns.result for node in flying.nodes.values() if node.turns is not None]
    largest = max(result.largest for result in results if result is not None)
    assert one.measured.configured == ()
    assert one.tube == pytest.approx(ceil(100.0 * largest) / 100.0, abs=0.011)
    # The emulated PX4 has four times the usual drag; no flight of the emulation was worse than this.
    assert 0.0 < one.tube < 0.5
    assert all(result is not None and result.acceleration >= 0.8 * 2.0 for result in results)


def test_without_a_go_nothing_arms_and_a_go_counts_in_turn() -> None:
    waiting = fleet(fly=FlightTerms(100, 4.0, Box(8.0, 0.0, 0.0)))
    assert run(waiting, 30.0).order == []
    one, three = waiting.nodes["preflight-1"], waiting.nodes["preflight-3"]
    assert one.turns is not None
    assert three.turns is not None
    assert (one.turns.asks, three.turns.asks) == (True, False)
    assert three.order(0, "go") == "go: not now: waiting for the flight of vehicle 1"
    assert one.order(0, "go") == ""
    # Two seconds more than with streams from the start: an ArduCopter streams nothing unasked.
    seen = run(waiting, 70.0)
    assert seen.order == [1]
    # The first has landed, and the go of the other one was not stored.
    assert (one.phase, three.turns.asks) == (Phase.TURNS, True)
    assert one.turns.result is not None
    assert not any(autopilot.armed for autopilot in waiting.autopilots.values())
    assert three.order(0, "land") == ""
    run(waiting)
    assert failed(one.verdict()) == {("vehicle 3", "report")}
    assert found(three.verdict(), "vehicle 3", "flight").text == "the operator ordered to land"


@pytest.mark.slow
def test_it_flies_the_box_and_comes_back() -> None:
    flying = fleet(fly=FlightTerms(100, 4.0, Box(-7.0, 6.0, 2.0), go=True))
    autopilot = flying.autopilots[1]
    places: list[Any] = []

    def look(_now: int) -> bool:
        if autopilot.armed:
            places.append(autopilot.state.position.copy())
        node = flying.nodes["preflight-1"]
        return node.turns is not None and node.turns.result is not None

    flying.loop.run(120 * SECOND, look)
    north, east, down = np.array(places).T
    assert east.min() == pytest.approx(-7.0, abs=1.5)
    assert north.max() == pytest.approx(6.0, abs=1.5)
    assert down.min() == pytest.approx(-6.0, abs=1.5)
    assert (east.max(), north.min()) == pytest.approx((0.0, 0.0), abs=1.5)
    assert abs(east[-1]) < 1.5
    assert abs(north[-1]) < 1.5
    drifts(flying, float(np.hypot(east, north)[: int(np.argmax(down < -3.5))].max()))


def drifts(flying: Fleet, climbing: float) -> None:
    """The drift is what the vehicle had while ``climbing`` (m), at least, and must be within the setting."""
    node = flying.nodes["preflight-1"]
    turns = node.turns
    assert turns is not None
    assert turns.result is not None
    assert turns.drift is not None
    assert climbing - 0.05 <= turns.drift < 1.0
    for allowed, tube, result in ((0.9, 0.0, Result.FAIL), (1.1, 0.0, Result.PASS), (0.9, 1.0, Result.PASS)):
        config = companion(certified={"drift": allowed * turns.drift})
        flown = turns.result._replace(largest=tube)
        checks = own_checks(1, config, node.autopilot, 1000, flown, turns.drift, doubled=False)
        assert [one.result for one in checks if one.name == "drift"] == [result]


class GroundStation:
    """Another controller, which sends commands to the autopilot of ``system`` once, at ``at_s``."""

    name = "ground-station"

    def __init__(self, system: int, at_s: float, *commands: tuple[int, tuple[float, ...]]) -> None:
        codec, source = Codec(), Source(255, 190)
        self._at = round(at_s * SECOND)
        self._orders = [
            codec.encode(CommandLong(source, system, 1, number, 0, (*params, *[0.0] * (7 - len(params)))))
            for number, params in commands
        ]

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        if now < self._at:
            return []
        sent, self._orders = self._orders, []
        return [Datagram(LINK, data) for data in sent]


def mode(number: int) -> tuple[int, tuple[float, ...]]:
    return mavlink.MAV_CMD_DO_SET_MODE, (float(mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED), float(number))


def test_a_pilot_who_takes_over_has_the_vehicle_and_ends_the_flights() -> None:
    flying = fleet(others={1: GroundStation(1, 16.0, mode(mavlink.COPTER_MODE_LOITER))})
    seen = run(flying, 60.0)
    assert seen.order == [1]
    verdict = flying.nodes["preflight-1"].verdict()
    assert found(verdict, "vehicle 1", "flight").text == "a pilot or another controller has the vehicle"
    assert flying.autopilots[1].armed
    assert flying.nodes["preflight-3"].verdict().fleet is None


def test_it_lands_when_another_vehicle_is_not_heard_any_more() -> None:
    flying = fleet()
    flying.loop.run(16 * SECOND)
    assert flying.autopilots[1].armed
    flying.nodes["preflight-3"]._due = lambda now: []  # type: ignore[method-assign]
    flying.loop.run(60 * SECOND)
    assert not flying.autopilots[1].armed
    assert (
        "vehicle 3 is not heard" in found(flying.nodes["preflight-1"].verdict(), "vehicle 1", "flight").text
    )


def test_nobody_takes_off_while_another_vehicle_is_armed() -> None:
    arm = mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (1.0,)
    ground = GroundStation(3, 8.0, mode(mavlink.COPTER_MODE_GUIDED), arm)
    flying = fleet(fly=FlightTerms(100, 4.0, EAST.box), others={3: ground})
    flying.loop.run(8 * SECOND)
    one = flying.nodes["preflight-1"]
    assert one.turns is not None
    assert one.turns.asks
    flying.loop.run(9_500_000)
    assert flying.autopilots[3].armed
    assert one.doing == "waiting: vehicle 3 is not disarmed"
    assert one.order(0, "go").startswith("go: not now")
    assert not flying.autopilots[1].armed


BAD: dict[str, tuple[dict[str, Any], str]] = {
    "the course leaves the box": (
        {"configs": dict.fromkeys((1, 3), settings(1, 3, box_max=[5.0, 30.0, 20.0]))},
        "outside limits.box",
    ),
    "the other one does not fly": ({"fly": {1: EAST}}, "needs preflight --fly, too"),
    "a dry run": ({"fly": {1: EAST, 3: FlightTerms(100, 4.0, EAST.box, dry=True)}}, "vehicle 3 does not fly"),
}


@pytest.mark.parametrize("what", BAD)
def test_if_a_condition_is_missing_nothing_arms_and_there_is_no_fleet_file(what: str) -> None:
    changes, words = BAD[what]
    flying = fleet(**changes)
    assert run(flying, 120.0).order == []
    verdict = flying.nodes["preflight-1"].verdict()
    assert words in found(verdict, "vehicle 1", "flight").text
    assert verdict.fleet is None


def test_a_check_that_fails_on_the_ground_keeps_all_there() -> None:
    narrow = dict.fromkeys((1, 3), settings(1, 3, v_max=[3.0, 3.0, 4.0]))
    flying = fleet(configs=narrow)
    assert run(flying, 120.0).order == []
    assert ("vehicle 1", "limits") in failed(flying.nodes["preflight-1"].verdict())


def test_a_dry_run_of_all_makes_a_fleet_file_without_flights() -> None:
    flying = fleet(fly=FlightTerms(100, 4.0, EAST.box, dry=True))
    assert run(flying, 120.0).order == []
    verdict = flying.nodes["preflight-1"].verdict()
    assert found(verdict, "vehicle 1", "flight")[2:] == (Result.NOTE, "a dry run does not fly")
    assert verdict.fleet is not None
    assert verdict.fleet.measured.configured == ("tube",)
