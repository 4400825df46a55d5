"""Certified flights in which a companion hangs or ends: its vehicle keeps to its plan all the same."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from companion.avoidance.certified.agreements import Agreements
from companion.node import Companion
from companion.planning.certified import CertifiedAvoidance
from outrider.certify.reading import read
from outrider.certify.verdict import judge
from outrider.runs.configuration import CONFIGURATION
from tests.scenarios.lockstep_flights import fly, scenario

SWAP: dict[str, Any] = {
    "vehicles": 3,
    "airborne": True,
    "sensors": "rtk",
    "cap_s": 12.0,
    "companion": {"avoidance": "certified", "turning_sense": "right"},
}
"""At 1.5 s all are under way at 4 m/s or so."""


def agreements(companion: Companion) -> Agreements:
    avoidance = companion.avoidance
    assert isinstance(avoidance, CertifiedAvoidance)
    return avoidance._flight.agreements


@pytest.mark.slow
@pytest.mark.parametrize(
    "fault", [{"kind": "freeze", "for_s": 3.0}, {"kind": "vanish"}], ids=["hangs", "ends"]
)
@pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
def test_a_plan_is_kept_whose_companion_is_silent(
    fault: dict[str, Any], flavour: str, tmp_path: Path
) -> None:
    struck = {"vehicle": 12, "at_s": 1.5, **fault}
    of = scenario(
        "antipodal-8", {**SWAP, "flavour": flavour, "faults": [struck], "autopilot": {"guided_timeout": 0.3}}
    )
    flown = fly(of, 1, tmp_path)
    flight = flown.flight
    silent = flight.backup_nodes[1]
    # Only the backup node of the one that was silent had anything to do.
    assert silent.carried > 40
    assert [backup_node.carried for backup_node in flight.backup_nodes if backup_node is not silent] == [0, 0]
    assert flown.summary["d_min_violations"] == 0
    assert flown.summary["anchored_anew"] == 0
    separation = flown.summary["min_separation_m"]
    assert isinstance(separation, float)
    assert separation > 1.0
    ended = fault["kind"] == "vanish"
    assert flown.summary["converged"] is not ended
    # The others hear that the plan is the last, and fly past its end to their goals.
    others = [c for c in flight.companions if c.name != "companion-12"]
    assert [12 in agreements(c).peers.left for c in others] == [ended] * 2
    assert flown.summary["others_converge_s"] is not None


@pytest.mark.slow
@pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
def test_a_companion_that_restarts_in_the_air_begins_where_the_plan_before_ends(
    flavour: str, tmp_path: Path
) -> None:
    """It begins 0.5 s later, while the backup node still flies at 4 m/s, and knows nothing of that plan."""
    struck = {"kind": "restart", "vehicle": 12, "at_s": 1.5, "for_s": 0.5}
    of = scenario(
        "antipodal-8", {**SWAP, "flavour": flavour, "faults": [struck], "autopilot": {"guided_timeout": 0.3}}
    )
    flown = fly(of, 1, tmp_path)
    # The rest of a plan of 3.5 s, with a set-point every 20 ms.
    assert flown.flight.backup_nodes[1].carried > 100
    assert flown.summary["converged"] is True
    assert flown.summary["d_min_violations"] == 0
    assert flown.summary["anchored_anew"] == 0
    tracking = flown.summary["tracking_error_m"]
    assert isinstance(tracking, dict)
    assert tracking["max"] is not None
    assert tracking["max"] < 0.5
    document = {"seed": 1, "scenario": of.model_dump(mode="json")}
    (tmp_path / CONFIGURATION).write_text(yaml.safe_dump(document), encoding="utf-8")
    evidence = read(tmp_path, lambda _name, _share: None)
    assert judge(evidence).certified


@pytest.mark.parametrize("flavour", ["ardupilot", pytest.param("px4", marks=pytest.mark.slow)])
def test_in_a_sound_flight_it_never_speaks(flavour: str, tmp_path: Path) -> None:
    """From the ground to the ground: nor while its companion lands."""
    of = scenario("antipodal-8", {**SWAP, "vehicles": 2, "airborne": False, "flavour": flavour})
    flown = fly(of, 1, tmp_path)
    assert [backup_node.carried for backup_node in flown.flight.backup_nodes] == [0, 0]
    assert flown.summary["converged"] is True
