"""Shipped scenarios and scenes over many seeds by ``outrider sweep``, and one under the wall clock: by the
command line, as a user would."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from outrider.resources import config_root

pytestmark = pytest.mark.soak

FLIGHTS, DRAWS = 12, 10
NAMES = {
    kind: [path.stem for path in sorted((config_root() / kind).glob("*.yaml"))]
    for kind in ("scenarios", "scenes")
}


def outrider(*words: str, cwd: Path) -> tuple[int, dict[str, Any]]:
    """Exit status and what is said in JSON."""
    done = subprocess.run(
        [sys.executable, "-m", "outrider", *words, "--json"],
        cwd=cwd,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode in (0, 1), done.stderr
    return done.returncode, json.loads(done.stdout)


def swept(kind: str, name: str, runs: int, folder: Path) -> tuple[int, dict[str, Any]]:
    """A sweep of one scenario or scene, as it is shipped."""
    sweep = folder / "sweep.yaml"
    sweep.write_text(json.dumps({"name": name, kind: [name], "runs": runs, "first_seed": 101}))
    status, summary = outrider("sweep", str(sweep), "--jobs", "1", cwd=folder)
    (cell,) = summary["cells"]
    assert cell["runs"] == runs
    assert cell["faults"] == cell["lost"] == 0
    assert not summary["wall"]["lost_on_the_way"]
    return status, cell


@pytest.mark.parametrize("name", NAMES["scenarios"])
def test_a_shipped_scenario_over_many_seeds(name: str, tmp_path: Path) -> None:
    status, cell = swept("scenarios", name, FLIGHTS, tmp_path)
    assert status == 0, cell["worst"]


@pytest.mark.parametrize("name", NAMES["scenes"])
def test_a_shipped_scene_over_many_draws(name: str, tmp_path: Path) -> None:
    """They may be too hard for the method, but each is flown to its end."""
    _, cell = swept("scenes", name, DRAWS, tmp_path)
    assert cell["ended"] == DRAWS


def test_a_short_flight_in_real_time(tmp_path: Path) -> None:
    status, summary = outrider(
        *("swarm", "antipodal-8", "--vehicles", "4", "--replan-hz", "20", "--real-time"), cwd=tmp_path
    )
    assert status == 0, summary
    assert summary["converged"]
    assert summary["messages"]["bad"] == 0
    assert summary["deadline_misses"] is not None
