"""Export of a run or a log as an MCAP, for Foxglove and PlotJuggler."""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from pathlib import Path

from outrider.export import mavlink_json, scene, series
from outrider.export.attitude import leanings
from outrider.export.mcap_file import Entry, McapFile
from outrider.export.written import Written
from outrider.logs.message_stream import Watch, watched
from outrider.runs import names
from outrider.runs.configuration import CONFIGURATION
from outrider.runs.source import Run

_ATTACHED = ((CONFIGURATION, "application/yaml"), (names.SUMMARY, "application/json"))
_PREPARED = 0.15
"""Share of the work that is done after the first pass through the logs, which reads the attitudes."""


def write(run: Run, path: Path, watch: Watch) -> Written:
    """Write all data of ``run`` to the MCAP at ``path``, in order of time."""
    sources = _pictures(run, watch)
    logs = watched(list(run.logs), watch, (_PREPARED, 1.0))
    sources += [mavlink_json.entries(log, messages) for log, messages in zip(run.logs, logs, strict=True)]
    with McapFile(path) as file:
        _attach(run, file)
        for one in heapq.merge(*sources, key=lambda one: one.time):
            file.write(one)
        return Written(file.channels, file.messages)


def _pictures(run: Run, watch: Watch) -> list[Iterator[Entry]]:
    """Return the sources that only a finished flight has: the 3-D scene and the plots."""
    if run.scenario is None or run.motion is None:
        return []
    logs = list(run.logs)
    said = {
        log.owner: leanings(messages, log.owner)
        for log, messages in zip(logs, watched(logs, watch, (0.0, _PREPARED)), strict=True)
        if log.owner is not None
    }
    stage = scene.Stage(run.scenario, run.motion, said)
    return [scene.bodies(stage), scene.frames(stage), scene.trails(stage), series.entries(run)]


def _attach(run: Run, file: McapFile) -> None:
    """Attach the configuration and the summary of the run, if the run has a recorded motion."""
    for name, kind in _ATTACHED:
        path = run.source / name
        if run.motion is not None and path.is_file():
            file.attach(name, kind, int(run.motion.start_us), path.read_bytes())
