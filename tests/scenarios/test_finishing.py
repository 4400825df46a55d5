"""A companion that finishes flies its plan to the end at rest and says farewell; the others fly on."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from companion.planning.certified import CertifiedAvoidance
from outrider.resources import config_root
from outrider.runs.summary import Cost, summarise
from outrider.simulation.flight import Flight
from tests.scenarios.lockstep_flights import FIREFLY, Watch, scenario
from tests.scenarios.test_backup_node_flights import SWAP

MEASURED: dict[str, Any] = {
    "companion": {
        "certified": {"fleet_time": "measured", "clock_us": 50_000, "time_sources": {"autopilot_us": 3000}}
    }
}
FINISHING = 1
AT_S = 1.5


@pytest.mark.slow
@pytest.mark.parametrize("time", [{}, MEASURED], ids=["own", "measured"])
def test_a_plan_is_finished_and_the_others_fly_on(time: dict[str, Any], tmp_path: Path) -> None:
    of = scenario("antipodal-8", {**SWAP, "cap_s": 25.0}, time)
    plans: set[bytes] = set()
    rested: list[int] = []
    began: list[int] = []

    def look(flight: Flight, now: int) -> None:
        began.append(now)
        companion = flight.companions[FINISHING]
        if now - began[0] < AT_S * 1e6 + 3e6:
            return
        avoidance = companion.avoidance
        assert isinstance(avoidance, CertifiedAvoidance)
        if not plans:
            companion.finish()
        flown = companion.flown
        if flown is not None:
            plans.add(np.round(flown.knots[-1], 9).tobytes())
        clock = flight.fleet.clock(FINISHING, began[0]).local(now)
        if companion.rests(clock):
            rested.append(now)

    watch, logs = Watch(), config_root() / "logs"
    flight = Flight(of, FIREFLY, 1, logs, progress=watch, run_directory=tmp_path, onlooker=look)
    flight.run()
    summary = summarise(flight.outcome, Cost(1.0, 1.0), tmp_path)
    # The end of the plan stays where it was, but for an epoch that had been announced.
    assert len(plans) <= 2
    assert rested
    assert summary["d_min_violations"] == 0
    separation = summary["min_separation_m"]
    assert isinstance(separation, float)
    assert separation > 1.0
    # The others have accepted the farewell.
    system = flight.systems[FINISHING]
    for k, companion in enumerate(flight.companions):
        avoidance = companion.avoidance
        assert isinstance(avoidance, CertifiedAvoidance)
        if k != FINISHING:
            assert system in avoidance._flight.agreements.peers.left
