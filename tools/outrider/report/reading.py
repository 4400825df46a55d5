"""Reader of a run directory.

A part that cannot be read is a ``Gap`` of the run; if no part can be read, ``read`` raises InputError.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TypeVar

from mavlink_bridge.errors import LogError
from outrider.errors import Fault, InputError
from outrider.report import arrays
from outrider.report.logs import read_log
from outrider.report.run import Gap, Log, Motions, Run
from outrider.runs import names
from outrider.runs.configuration import CONFIGURATION, Resolved
from outrider.yaml_files.yaml_file import load

_ALLOWED = "allowed: what outrider swarm leaves"
_MOST_BYTES = 1 << 20
"""Largest size of a summary or a configuration."""
_DIGITS = 18
"""Largest number of characters of an integer in a summary; no count needs more."""

Watch = Callable[[str, float], None]
Sift = Callable[[Log, Motions | None], Log]
Value = TypeVar("Value")


def read(
    directory: Path,
    watch: Watch = lambda _what, _share: None,
    sift: Sift = lambda log, _motions: log,
) -> Run:
    """Read all data in ``directory``.

    ``watch`` is called with the name of the log being read and the share (0…1) of all logs' bytes that have
    been read. ``sift`` receives each log, and the true motions if they are available, and returns the part of
    the log to be kept. Raises InputError if ``directory`` is not a directory, or holds neither a summary, nor
    a configuration, nor true motions, nor a log that can be read.
    """
    if not directory.is_dir():
        wrong = "not a directory" if directory.exists() else "no such directory"
        raise InputError(Fault(str(directory), f"{wrong}; {_ALLOWED}"))
    gaps: list[Gap] = []

    def part(name: str, reader: Callable[[Path], Value]) -> Value | None:
        try:
            if not (directory / name).exists():
                raise InputError("is not there")
            return reader(directory / name)
        except InputError as error:
            more = f", and {len(error.faults) - 1} more" if len(error.faults) > 1 else ""
            gaps.append(Gap(name, _without_place(str(error).partition("\n")[0], directory / name) + more))
        return None

    summary = part(names.SUMMARY, _summary)
    configuration = part(CONFIGURATION, _text)
    resolved = None if configuration is None else part(CONFIGURATION, lambda path: load(path, Resolved))
    motions = part(names.FLIGHT, arrays.motions)
    plans, plan_times = part(names.PLANS, arrays.plans), part(names.PLAN_TIMES, arrays.plan_times)
    scenario = None if resolved is None else resolved.scenario
    logs = _logs(
        directory,
        () if scenario is None else scenario.systems,
        gaps,
        watch,
        lambda log: sift(log, motions),
    )
    if summary is None and resolved is None and motions is None and not logs:
        why = "holds no run"
        for gap in gaps:
            if (directory / gap.what).exists():
                why = f"holds nothing of a run that can be read ({gap.what}: {gap.why})"
                break
        raise InputError(Fault(str(directory), f"{why}; {_ALLOWED}"))
    return Run(
        directory,
        dict(summary or {}),
        configuration or "",
        None if resolved is None else resolved.seed,
        scenario,
        motions,
        plans,
        plan_times,
        logs,
        tuple(gaps),
    )


def _without_place(said: str, path: Path) -> str:
    """Remove the path of the run from a message: the present location of the run is irrelevant."""
    for prefix in (f"{path}:", f"{path.name}:"):
        said = said.removeprefix(prefix)
    return said.replace(str(path), path.name).strip()


def _text(path: Path) -> str:
    try:
        data = path.read_bytes()[: _MOST_BYTES + 1]
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}") from None
    if len(data) > _MOST_BYTES:
        raise InputError(f"is larger than {_MOST_BYTES} bytes")
    return data.decode("utf-8", errors="replace")


def _summary(path: Path) -> Mapping[str, object]:
    try:
        found = json.loads(_text(path), parse_float=_finite, parse_int=_moderate, parse_constant=_finite)
    except (ValueError, RecursionError) as error:
        raise InputError(f"is not JSON: {error}") from None
    if not isinstance(found, dict):
        raise InputError("is no JSON object")
    return found


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{text} is no number")
    return value


def _moderate(text: str) -> int:
    if len(text) > _DIGITS:
        raise ValueError(f"a number of {len(text)} digits")
    return int(text)


def _logs(
    directory: Path,
    systems: range | tuple[()],
    gaps: list[Gap],
    watch: Watch,
    sift: Callable[[Log], Log],
) -> tuple[Log, ...]:
    """Read the logs of the fleet, and any other vehicle's log in the directory."""
    there = {}
    for path in directory.iterdir():
        fits = re.fullmatch(r"vehicle-(\d{1,3})\.tlog", path.name)
        if fits is not None and path.is_file():
            there[int(fits[1])] = path
    gaps += [Gap(names.log(system), "is not there") for system in systems if system not in there]
    if not there and not systems:
        gaps.append(Gap("vehicle-*.tlog", "there is none"))
    size = sum(path.stat().st_size for path in there.values()) or 1
    logs, done = [], 0
    for system, path in sorted(there.items()):

        def at(read: int, name: str = path.name, before: int = done) -> None:
            watch(name, (before + read) / size)

        try:
            log = read_log(system, path, at)
            logs.append(sift(log))
            if log.report.bad or log.report.truncated:
                gaps.append(Gap(path.name, _damage(log)))
        except LogError as error:
            gaps.append(Gap(path.name, _without_place(str(error), path)))
        done += path.stat().st_size
    return tuple(logs)


def _damage(log: Log) -> str:
    report = log.report
    said = [f"{report.bad} damaged places, {report.skipped_bytes} bytes skipped"] if report.bad else []
    if report.truncated:
        said.append("breaks off")
    return f"{' · '.join(said)}; {report.good} messages are sound"
