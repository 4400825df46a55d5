"""``outrider preflight`` on vehicles of ``outrider sitl``, as processes on real links. These tests really
wait; they assert no timing."""

from __future__ import annotations

import json
import random
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from outrider.resources import find
from outrider.scenarios.fleet_file import FleetFile, with_fleet_file
from outrider.scenarios.fly_config import FlyConfig
from outrider.yaml_files.yaml_file import load
from tests.outrider.sitl_server.test_command import free_base, sitl

pytestmark = pytest.mark.slow
PATIENCE = 120.0


def own_file(folder: Path, **changes: object) -> Path:
    """The shipped file without an accuracy of its own."""
    document = yaml.safe_load(find("companions", "ardupilot").read_text(encoding="utf-8"))
    del document["companion"]["field"]["position_sigma"]
    path = folder / "own.yaml"
    path.write_text(yaml.safe_dump({**document, **changes}), encoding="utf-8")
    return path


def check(
    folder: Path, base: int, systems: tuple[int, ...], group: str, *options: str
) -> list[tuple[int, str, str]]:
    """Status and output of the check of each vehicle, at once."""
    running = [
        subprocess.Popen(
            [
                *(sys.executable, "-m", "outrider", "preflight", "--json", f"--config={folder / 'own.yaml'}"),
                *(f"--autopilot=tcp:127.0.0.1:{base + 10 * k}", f"--swarm=mcast:{group},127.0.0.1"),
                *(f"--system={system}", "--roster=1,2", "--seconds=5", "--wait=60"),
                f"--out={folder / f'fleet-{system}-{k}.yaml'}",
                *options,
            ],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        for k, system in enumerate(systems)
    ]
    return [(one.returncode, *outputs) for one in running for outputs in (one.communicate(timeout=PATIENCE),)]


def group() -> str:
    """A multicast group that no other test uses."""
    return f"239.255.{random.randrange(1, 250)}.{random.randrange(1, 250)}:{random.randrange(20_000, 28_000)}"


def test_two_vehicles_write_the_same_file_which_their_companions_take(tmp_path: Path) -> None:
    own_file(tmp_path)
    base = free_base("ardupilot", 2)
    with sitl("--count=2", f"--port-base={base}"):
        ended = check(tmp_path, base, (1, 2), group())
    for status, out, err in ended:
        assert status == 0, out + err
        assert "Traceback" not in err
        assert json.loads(out)["ready"]
    one, two = ((tmp_path / f"fleet-{k + 1}-{k}.yaml").read_bytes() for k in (0, 1))
    assert one == two
    fleet = load(tmp_path / "fleet-1-0.yaml", FleetFile)
    path = own_file(tmp_path, fleet="fleet-1-0.yaml", system=1)
    config = with_fleet_file(load(path, FlyConfig), path)
    assert config.companion.field.position_sigma == fleet.position_sigma


def test_two_processes_with_one_id_both_fail(tmp_path: Path) -> None:
    own_file(tmp_path)
    base = free_base("ardupilot", 2)
    with sitl("--count=2", f"--port-base={base}"):
        ended = check(tmp_path, base, (1, 1), group())
    for status, out, err in ended:
        assert status == 1, out + err
        failed = [one for one in json.loads(out)["checks"] if one["result"] == "fail"]
        assert "another companion has this id" in [one["text"] for one in failed]
    assert not list(tmp_path.glob("fleet-*"))


def test_a_dry_run_shows_what_it_would_write_and_writes_and_flies_nothing(tmp_path: Path) -> None:
    own_file(tmp_path)
    base = free_base("ardupilot", 2)
    with sitl("--count=2", f"--port-base={base}"):
        ended = check(tmp_path, base, (1, 2), group(), "--dry-run", "--fly")
    for status, out, err in ended:
        assert status == 0, out + err
        found = json.loads(out)
        assert (found["ready"], found["file"], found["fleet"]["roster"]) == (True, None, [1, 2])
        assert "a dry run does not fly" in [one["text"] for one in found["checks"]]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["own.yaml"]
