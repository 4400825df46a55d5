"""A flight is gone through again from its logs: the same bytes, for every shipped scenario and method."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mavlink_bridge.tlog.log import TlogWriter, read_tlog
from outrider.replay.run_replay import again
from outrider.resources import config_root
from outrider.runs.steps_file import read_steps
from outrider.scenarios.options import METHODS
from outrider.scenarios.scenario import Scenario
from outrider.simulation.preparation import Prepared
from outrider.swarm import command as swarm
from tests.outrider.said import Run
from tests.outrider.shipped import FIREFLY, scenario

SHORT: dict[str, Any] = {"cap_s": 2.0, "airborne": True}
FAST = {"antipodal-8"}
"""Scenarios that are also flown by `make test`."""
SCENARIOS = sorted(path.stem for path in (config_root() / "scenarios").glob("*.yaml"))
WAYS: dict[str, dict[str, Any]] = {
    **{method: {"methods": [method]} for method in METHODS},
    "tangential+swivel": {"methods": ["tangential", "swivel"]},
    "certified": {"avoidance": "certified", "turning_sense": "right"},
}


def flown(of: Scenario, directory: Path) -> Path:
    directory.mkdir()
    swarm.fly(Prepared(of, FIREFLY), 1, directory, lambda _stage, _seconds: None)
    return directory


def short(name: str, **companion: Any) -> Scenario:
    changes = {**SHORT, "companion": companion}
    if name == "escort":
        changes = {"target": {"duration_s": 2.0}, "companion": companion}
    return scenario(name, **changes)


@pytest.mark.parametrize(
    "name",
    [name if name in FAST else pytest.param(name, marks=pytest.mark.slow) for name in SCENARIOS],
)
def test_every_scenario_is_the_same_again(name: str, tmp_path: Path) -> None:
    for one in again(flown(short(name), tmp_path / "run")):
        assert one.identical, one
        assert one.setpoints > 50


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS)
def test_so_is_every_method(way: str, tmp_path: Path) -> None:
    for one in again(flown(short("scenario-2", **WAYS[way]), tmp_path / "run")):
        assert one.identical, one
        assert one.setpoints > 50


@pytest.mark.soak
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", SCENARIOS)
def test_so_is_every_method_in_every_scenario(name: str, way: str, tmp_path: Path) -> None:
    for one in again(flown(short(name, **WAYS[way]), tmp_path / "run")):
        assert one.identical, one
        assert one.setpoints > 50


def test_so_is_a_flight_in_which_everything_goes_wrong(tmp_path: Path) -> None:
    """Hung and ended companions, wrong clocks, bad links, and noise."""
    of = scenario(
        "antipodal-8",
        **SHORT,
        vehicles=4,
        sensors="gnss",
        links={
            "swarm": {"loss": 0.3, "delay_ms": 60.0, "jitter_ms": 30.0, "duplication": 0.2, "reordering": 0.2}
        },
        partitions=[{"at_s": 0.5, "for_s": 0.7, "members": [11, 12]}],
        faults=[
            {"kind": "freeze", "vehicle": 12, "at_s": 0.8, "for_s": 0.6},
            {"kind": "vanish", "vehicle": 13, "at_s": 1.2},
            {"kind": "clock", "vehicle": 14, "late_ms": 200.0, "drift_ppm": 40.0},
        ],
    )
    for one in again(flown(of, tmp_path / "run")):
        assert one.identical, one


@pytest.fixture(scope="module")
def run_dir(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return flown(scenario("antipodal-8", **SHORT, vehicles=2), tmp_path_factory.mktemp("flown") / "run")


def test_other_peoples_reader_finds_nothing_bad_in_our_logs(run_dir: Path) -> None:
    """mavlogdump of pymavlink, the one that MAVProxy users have: every record, and no BAD_DATA."""
    tool = Path(sys.executable).with_name("mavlogdump.py")
    for system in (11, 12):
        log = run_dir / f"vehicle-{system}.tlog"
        dump = subprocess.run([sys.executable, tool, log], capture_output=True, text=True, check=True)
        lines = dump.stdout.splitlines()
        assert len(lines) == sum(1 for _ in read_tlog(log))
        assert not [line for line in lines if "BAD_DATA" in line or "UNKNOWN" in line]


@pytest.fixture
def copy(run_dir: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(run_dir, tmp_path / "copy"))


def test_the_command_says_so(run_dir: Path, run: Run) -> None:
    ended = run("replay", str(run_dir), "--json")
    assert (ended.status, ended.err) == (0, "")
    said = json.loads(ended.out)
    assert said["identical"] is True
    assert [one["system_id"] for one in said["vehicles"]] == [11, 12]
    assert "the same to the last bit" in run("replay", str(run_dir)).out


def test_another_gain_is_found_and_named(copy: Path, run: Run) -> None:
    path = copy / "configuration.yaml"
    path.write_text(path.read_text().replace("gain: 10.0", "gain: 11.0", 1))
    ended = run("replay", str(copy), "--json")
    assert ended.status == 1
    said = json.loads(ended.out)
    assert said["identical"] is False
    first = said["vehicles"][0]["first_difference"]
    assert "→" in first
    assert "µs" in first
    assert "not the same" in run("replay", str(copy)).out


def test_a_record_that_is_lost_is_noticed(copy: Path) -> None:
    path = copy / "vehicle-11.tlog"
    records = list(read_tlog(path))
    # A set-point of its own that the log lacks.
    gone = next(k for k, one in enumerate(records) if one.frame[7] == 84 and one.frame[6] == 195)
    with TlogWriter(path) as writer:
        for k, record in enumerate(records):
            if k != gone:
                writer.write(record.time | record.link, record.link, record.frame)
    assert [one.different for one in again(copy)] == [1, 0]


def test_steps_that_are_lost_leave_records_without_one(copy: Path) -> None:
    path = copy / "vehicle-12.steps.npz"
    times = read_steps(path)[:-200]
    np.savez_compressed(path, first=times[:1], gaps=np.diff(times))
    assert [one.stray > 0 for one in again(copy)] == [False, True]


@pytest.mark.parametrize("name", ["vehicle-11.tlog", "vehicle-11.steps.npz", "configuration.yaml"])
def test_what_is_missing_or_damaged_is_named(name: str, copy: Path, run: Run) -> None:
    path = copy / name
    if name.endswith(".npz"):
        path.write_bytes(path.read_bytes()[:40])
        ended = run("replay", str(copy))
        assert ended.status == 2
        assert name in ended.err
    path.unlink()
    ended = run("replay", str(copy))
    assert ended.status == 2
    assert name in ended.err
    assert ended.err.count("\n") == 1


def test_a_directory_that_is_none_is_refused(tmp_path: Path, run: Run) -> None:
    for path in (tmp_path / "nowhere", tmp_path):
        ended = run("replay", str(path))
        assert ended.status == 2
        assert str(path) in ended.err
