"""Runs of ``outrider fly`` are certified as the same flight of a scenario is."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pytest
import yaml

from companion.avoidance.certified.fingerprint import identity
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.tlog.log import Record, TlogWriter, read_tlog
from outrider.certify.reading import read
from outrider.certify.verdict import Verdict, judge
from outrider.errors import InputError
from outrider.runs.configuration import resolved
from outrider.scenarios.companion_settings import settings_of


def verdict(directory: Path) -> Verdict:
    return judge(read(directory, lambda _name, _share: None))


def as_fly(flown: Path, place: Path, **changes: Any) -> Path:
    """The same logs, each in a directory of ``outrider fly``."""
    scenario = resolved(flown, "").scenario
    companion = settings_of(scenario)
    for system in scenario.systems:
        directory = place / f"fly-{system}"
        directory.mkdir(parents=True)
        shutil.copy(flown / f"vehicle-{system}.tlog", directory)
        document = {
            "system": system,
            "target": 250,
            "origin": scenario.origin.model_dump(),
            "clock": "wall",
            "companion": companion.model_dump(mode="json"),
        }
        document["companion"]["certified"]["fleet"] = list(scenario.systems)
        if system == scenario.systems[0]:
            document["companion"]["field"] |= changes
        (directory / "configuration.yaml").write_text(yaml.safe_dump(document), encoding="utf-8")
    return place


def write(path: Path, records: list[Record]) -> None:
    path.parent.mkdir(exist_ok=True)
    with TlogWriter(path) as writer:
        for record in records:
            writer.write(record.time - record.time % 4, record.time % 4, record.frame)


def test_the_verdict_is_that_of_the_scenario(flown: Path, tmp_path: Path) -> None:
    known, found = verdict(flown), verdict(as_fly(flown, tmp_path))
    assert found.document() == known.document()
    assert found.certified
    assert found.pairs.checked > 10


def split(flown: Path, place: Path, share: float) -> tuple[Path, Path]:
    """The last part of a log that its own process lost is in that of its backup node, a little later."""
    run = as_fly(flown, place)
    log = next((run / "fly-12").glob("vehicle-12.tlog"))
    records = list(read_tlog(log))
    write(log, records[: round(share * len(records))])
    late = [record._replace(time=record.time + 8_000) for record in records]
    backup = run / "fly-12" / "backup-1" / log.name
    write(backup, late)
    return run, backup


def test_a_killed_companions_last_messages_are_in_the_log_of_its_backup_node(
    flown: Path, tmp_path: Path
) -> None:
    run, backup = split(flown, tmp_path, 0.98)
    assert verdict(run).certified
    backup.unlink()
    lost = verdict(run)
    assert not lost.certified
    assert {finding.what for finding in lost.findings} <= {
        "a plan received that its sender did not send",
        "a statement received that its sender did not send",
        "a plan without a statement",
    }


def test_copies_change_nothing(flown: Path, tmp_path: Path) -> None:
    """Nor does the time at which the backup node logs them."""
    run, _ = split(flown, tmp_path, 1.0)
    assert verdict(run).certified
    assert verdict(run).kept == verdict(flown).kept


def test_the_logs_of_a_companion_that_began_again_are_read_as_one(flown: Path, tmp_path: Path) -> None:
    run = as_fly(flown, tmp_path)
    log = run / "fly-11" / "vehicle-11.tlog"
    records = list(read_tlog(log))
    half = len(records) // 2
    write(run / "fly-11" / "restart-1" / log.name, records[half:])
    write(log, records[:half])
    assert verdict(run).document() == verdict(flown).document()


def test_companions_with_other_settings_are_refused(flown: Path, tmp_path: Path) -> None:
    run = as_fly(flown, tmp_path, d_min=0.9)
    with pytest.raises(InputError, match=r"fleet_identity.*allowed: the same for all vehicles"):
        read(run, lambda _name, _share: None)


def test_the_identity_is_that_of_the_companions(flown: Path, tmp_path: Path) -> None:
    scenario = resolved(flown, "").scenario
    evidence = read(as_fly(flown, tmp_path), lambda _name, _share: None)
    companion = settings_of(scenario)
    assert evidence.terms.fleet == tuple(scenario.systems)
    named = companion.certified.model_copy(update={"fleet": tuple(scenario.systems)})
    config = companion.model_copy(update={"certified": named})
    origin = scenario.origin
    frame = FleetFrame(origin.latitude, origin.longitude, origin.altitude)
    assert evidence.terms.fleet_identity == identity(config, frame)
