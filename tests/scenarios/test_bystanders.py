"""Vehicles that are not of the ring: they hover or come through, share no plan, and give way to nobody."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mavlink_bridge.messages import GlobalPosition, Tunnel
from mavlink_bridge.tlog.log import read_tlog
from mavlink_bridge.wire.codec import Codec
from outrider.runs.summary import exit_status
from outrider.simulation.bystander import Bystander
from tests.scenarios.flight_facts import check_told, clock
from tests.scenarios.lockstep_flights import fly, scenario

SHORT = {"airborne": True, "cap_s": 8.0, "sensors": "truth"}


def test_they_hover_where_they_are_while_the_others_pass(tmp_path: Path) -> None:
    of = scenario("scenario-2", SHORT)
    flown = fly(of, 1, tmp_path)
    check_told(flown)
    samples, _ = clock(flown)
    companions = flown.flight.companions
    assert [isinstance(companion, Bystander) for companion in companions] == [False] * 3 + [True] * 2
    assert flown.summary["vehicles"] == 5
    starts = flown.flight.fleet.starts.positions
    still = np.linalg.norm(samples.position[:, 3:] - starts[3:], axis=-1)
    assert still.max() < 0.1
    # The others have gone 16 m.
    assert (samples.position[-1, :3, 0] > 2.0).all()
    # They were seen by who had to pass them.
    for companion in companions[:3]:
        assert {14, 15} <= set(companion.world.neighbours.obstacles(0).ids)


def test_they_say_where_they_are_and_share_no_plan(tmp_path: Path) -> None:
    flown = fly(scenario("scenario-2", {**SHORT, "cap_s": 3.0}), 1, tmp_path)
    codec = Codec()
    kinds: dict[type, set[int]] = {}
    for record in read_tlog(flown.logs[0]):
        for message in codec.feed(record.frame):
            if message.source.component == 195:
                kinds.setdefault(type(message), set()).add(message.source.system)
    assert kinds[GlobalPosition] == {11, 12, 13, 14, 15}
    assert kinds[Tunnel] == {11, 12, 13}


@pytest.mark.slow
@pytest.mark.parametrize("avoidance", ["field", "certified"])
def test_who_comes_through_is_evaded(avoidance: str, tmp_path: Path) -> None:
    """A stranger at 2 m/s, straight through the ring: the n = 0 fallback is enough, and so is yielding to
    it where plans are certified."""
    change = {"airborne": True, "cap_s": 25.0, "companion": {"avoidance": avoidance}}
    flown = fly(scenario("adversary", change), 1, tmp_path)
    check_told(flown)
    samples, _ = clock(flown)
    through = samples.position[:, 5:]
    assert (through[-1, 0, 0], through[-1, 1, 1]) > (10.0, -30.0)
    assert through[-1, 1, 1] < -5.0
    # It did not give way: it kept its line.
    assert np.abs(through[:, 0, 1] - flown.flight.fleet.starts.positions[5, 1]).max() < 0.6
    assert flown.summary["d_min_violations"] == 0
    assert exit_status(flown.summary) == 0
