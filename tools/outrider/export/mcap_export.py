"""Export of a run or a log as an MCAP, for Foxglove and PlotJuggler."""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from mavlink_bridge.frames import FleetFrame
from outrider.export import mavlink_json, multirotor, scene, series
from outrider.export.attitude import leanings
from outrider.export.foxglove_layout import layout, layout_path
from outrider.export.mcap_file import Entry, McapFile
from outrider.export.written import Written
from outrider.logs.message_stream import Watch, watched
from outrider.runs import names
from outrider.runs.arrays import Motion
from outrider.runs.configuration import CONFIGURATION
from outrider.runs.source import Run
from outrider.scenarios.scenario import Scenario
from outrider.scene.recorded import record

_ATTACHED = ((CONFIGURATION, "application/yaml"), (names.SUMMARY, "application/json"))
_PREPARED = 0.15
"""Share of the work that is done after the first pass through the logs, which reads the attitudes."""


def write(run: Run, path: Path, watch: Watch) -> Written:
    """Write all data of ``run`` to the MCAP at ``path``, in order of time, and a layout beside it."""
    sources = _pictures(run, watch)
    logs = watched(list(run.logs), watch, (_PREPARED, 1.0))
    sources += [mavlink_json.entries(log, messages) for log, messages in zip(run.logs, logs, strict=True)]
    with McapFile(path) as file:
        _attach(run, file)
        for one in heapq.merge(*sources, key=lambda one: one.time):
            file.write(one)
        written = Written(file.channels, file.messages)
    if run.scenario is not None and run.motion is not None and len(run.motion.time):
        layout_path(path).write_text(_layout(run.scenario, run.motion), encoding="utf-8")
    return written


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
    return [
        scene.bodies(stage),
        scene.frames(stage),
        scene.trails(stage),
        _plans(run.scenario, run.motion, run.source),
        series.entries(run),
    ]


def _plans(scenario: Scenario, motion: Motion, directory: Path) -> Iterator[Entry]:
    """Return the plans that the vehicles shared; of a vehicle without a log there is none."""
    origin, companion = scenario.origin, scenario.companion
    frame = FleetFrame(origin.latitude, origin.longitude, origin.altitude)
    paths = [(system, directory / names.log(system)) for system in scenario.systems]
    records = [(system, record(path, system, frame)) for system, path in paths if path.is_file()]
    step = 1e-6 * companion.certified.dt_us if companion.avoidance == "certified" else None
    return multirotor.plans(motion.time.tolist(), records, scene.colors(scenario), step)


def _layout(scenario: Scenario, motion: Motion) -> str:
    """Return a layout whose camera has the whole flight in its picture."""
    places = motion.position[np.isfinite(motion.position).all(axis=-1)]
    if not len(places):
        return layout(scenario, (0.0, 0.0, 0.0), 20.0)
    low, high = places.min(axis=0), places.max(axis=0)
    return layout(scenario, (0.5 * (low + high)).tolist(), max(1.3 * float(np.linalg.norm(high - low)), 10.0))


def _attach(run: Run, file: McapFile) -> None:
    """Attach the configuration and the summary of the run, if the run has a recorded motion."""
    for name, kind in _ATTACHED:
        path = run.source / name
        if run.motion is not None and path.is_file():
            file.attach(name, kind, int(run.motion.start_us), path.read_bytes())
