"""Command ``outrider replay LOG``: compares what a companion would have sent with what was sent."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

from mavlink_bridge.errors import LogError
from mavlink_bridge.tlog.log import Record, read_tlog
from outrider.errors import InputError
from outrider.replay.target_replay import prepared, setpoints
from outrider.resources import find
from outrider.runs import names
from outrider.runs.directories import new_directory
from outrider.scenarios.scenario import FIRST_SYSTEM, Scenario
from outrider.shadow.findings import damage, damaged_records, document_of, leave
from outrider.shadow.roles import Roles, check, survey
from outrider.shadow.shadow_run import ShadowRun, shadow_flight
from outrider.simulation.console import progress
from outrider.swarm.command import fly
from outrider.terminal.lines import say
from outrider.terminal.share_progress import share_progress
from outrider.yaml_files.yaml_file import load

Pacing = Callable[[Iterable[Record]], Iterable[Record]]
"""Filter that passes records on when they are due."""


def replay_log(log: Path, cast: Roles, like: str, out: Path | None, as_json: bool, pacing: Pacing) -> int:
    """Run a companion over ``log`` with the settings of scenario ``like``, and report.

    Returns the exit status: 0, or 1 if the companion would have sent nothing. ``setpoints.csv``,
    ``replay.json`` and ``replay.png`` are written to ``out``. Raises InputError for a log that cannot be
    read, for ids that are not in it, and for certified avoidance.
    """
    config = load(find("scenarios", like), Scenario).companion
    if config.avoidance == "certified":
        raise InputError(f"--like {like}: certified plans cannot be rehearsed; allowed: avoidance 'field'")
    try:
        seen = survey(read_tlog(log), cast.own, str(log))
        check(log, cast, seen)
        directory = _directory(out, f"{_stem(log)}-own-{cast.own}")
        with share_progress() as watch:

            def reported(now: int, _read: int) -> None:
                watch(log.name, (now - seen.begin) / max(seen.end - seen.begin, 1))

            reader = read_tlog(log)
            found = shadow_flight(config, cast, seen, pacing(reader), reported)
            found.damaged = damaged_records(reader.report, found.records)
    except LogError as error:
        raise InputError(str(error)) from None
    _tell(f"{log.name} · vehicle {cast.own}", found, directory, as_json)
    if line := damage(log.name, found):
        say(line)
    if found.would:
        return 0
    missing = max(found.reasons, key=lambda reason: found.reasons[reason], default="any message of it")
    sys.stderr.write(f"outrider: {log}: nothing would have been sent: the log lacks {missing}\n")
    return 1


def chasing(log: Path, target: int, like: str, out: Path | None, as_json: bool) -> int:
    """Fly an own vehicle around ``target``, report what it was sent, and return 0.

    The run and the files of ``replay_log`` are written to ``out``. Raises InputError for a log that cannot be
    read, for a target that is not in it, and for settings that cannot be flown.
    """
    try:
        seen = survey(read_tlog(log), target, str(log))
        flight = prepared(log, seen, target, like)
        directory = _directory(out, f"{_stem(log)}-target-{target}")
        with progress(flight.scenario.duration_s) as watch:
            fly(flight, 1, directory, watch)
    except LogError as error:
        raise InputError(str(error)) from None
    reported = setpoints(directory / names.log(FIRST_SYSTEM))
    _tell(f"{log.name} · target {target}", ShadowRun(would=reported), directory, as_json)
    return 0


def _tell(title: str, found: ShadowRun, directory: Path, as_json: bool) -> None:
    document = document_of(found)
    leave(directory, title, found, document)
    if as_json:
        sys.stdout.write(json.dumps(document) + "\n")
    else:
        _show(title, document, directory)


def _directory(out: Path | None, stem: str) -> Path:
    """Create a new, empty directory: ``out``, or the first free ``runs/replay-STEM[-k]``."""
    return new_directory(out, f"replay-{stem}")


def _stem(log: Path) -> str:
    return log.name.split(".")[0]


_ROWS = {
    "setpoints": "set-points",
    "finite": "all finite",
    "max_step_m": "largest step from one to the next, m",
    "max_speed_m_s": "largest speed, m/s",
    "max_acceleration_m_s2": "largest acceleration, m/s²",
    "gaps": "pauses of more than 0.1 s",
    "mask_counts": "type masks: how many",
    "frames": "frames: how many",
}


def _show(title: str, document: dict[str, object], directory: Path) -> None:
    sent, apart_m, reasons = document["sent"], document["apart_m"], document["reasons"]
    said = isinstance(sent, dict) and sent["setpoints"]
    table = Table("", "would have been sent", *(["was sent"] if said else []))
    for key, words in _ROWS.items():
        before = [_text(sent[key])] if said and isinstance(sent, dict) else []
        table.add_row(words, _text(document[key]), *before)
    if said and isinstance(apart_m, dict):
        table.add_row("apart, m: p50, p95", f"{_text(apart_m['p50'])}, {_text(apart_m['p95'])}", "")
    console = Console()
    # Printed above the table, so that a long name is not broken.
    console.print(Text(title), soft_wrap=True)
    console.print(table)
    if isinstance(reasons, dict):
        for words, steps in sorted(reasons.items(), key=lambda pair: -pair[1]):
            line = Text(f"{steps * 0.01:8.2f} s without a set-point for want of {words}")
            console.print(line, soft_wrap=True)
    files = ", ".join(sorted(path.name for path in directory.iterdir()))
    console.print(Text(f"{directory}: {files}"), soft_wrap=True)


def _text(value: object) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{key}: {count}" for key, count in value.items())
    return "" if value is None else str(value)
