"""Links that lose, delay, repeat and reorder: nobody comes too near, and all arrive. Links that carry
nothing: nobody takes off."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from outrider.runs.figures import draw
from outrider.runs.summary import exit_status
from outrider.simulation import conductor
from tests.scenarios.lockstep_flights import Flown, check, fly, scenario

POOR = {"loss": 0.2, "delay_ms": 100.0, "jitter_ms": 50.0, "duplication": 0.1, "reordering": 0.1}


@dataclass(frozen=True)
class Poor:
    """Which links are bad, and how."""

    name: str
    links: dict[str, Any]
    vehicles: int = 3
    seed: int = 1


ROWS = (
    Poor("to the others", dict.fromkeys(("swarm", "target", "ground"), POOR), vehicles=4),
    Poor("to the autopilot", {"autopilot": {**POOR, "delay_ms": 20.0, "jitter_ms": 10.0}}),
)


def dropped(flown: Flown) -> int:
    messages = flown.summary["messages"]
    assert isinstance(messages, dict)
    return int(messages["dropped"] or 0)


@pytest.mark.slow
@pytest.mark.parametrize("row", [pytest.param(row, id=row.name) for row in ROWS])
def test_poor_links_hold_up_nobody(row: Poor, tmp_path: Path) -> None:
    of = scenario("antipodal-8", {"vehicles": row.vehicles, "links": row.links})
    flown = fly(of, row.seed, tmp_path)
    check(flown)
    assert flown.summary["converged"] is True
    assert dropped(flown) > 500


@pytest.mark.parametrize(
    ("link", "missing"), [("autopilot", "a heartbeat of the autopilot"), ("ground", "the operator's go")]
)
def test_without_a_link_nobody_takes_off_and_it_is_said_why(
    link: str, missing: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(conductor, "PREPARE_CAP", 4_000_000)
    of = scenario("antipodal-8", {"vehicles": 2, "links": {link: {"loss": 1.0}}})
    flown = fly(of, 1, tmp_path)
    assert flown.summary["failure"] == "; ".join(f"companion-{k} waits for {missing}" for k in (11, 12))
    assert exit_status(flown.summary) == 1
    assert flown.flight.conductor.clock_start is None
    assert not any(autopilot.airborne for autopilot in flown.flight.autopilots)
    draw(flown.flight.outcome, flown.summary, tmp_path / "flight.png")
    assert (tmp_path / "flight.png").stat().st_size > 1_000
