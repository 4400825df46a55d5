"""Player of a run directory: forward or to any time, at any speed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import nan
from pathlib import Path

import numpy as np

from mavlink_bridge.frames import FleetFrame
from outrider.errors import Fault, InputError
from outrider.runs import names
from outrider.runs.arrays import Motion, Plans
from outrider.runs.source import read
from outrider.scene.airframe import airframe
from outrider.scene.recorded import Record, record
from outrider.scene.scene import Scene, staged
from outrider.scene.snapshot import Snapshot, State
from outrider.scene.view_commands import ViewCommands

PAST, PAST_EVERY = 20.0, 0.2
"""Length (s) of the trails that are drawn again after a jump, and the interval (s) of their samples."""
FAST = 16.0
"""Multiple of real time that is used if the chosen speed is None."""
_STEP = 0.1
"""Duration of a single step (s)."""
_ROUNDING_S = 1e-6

Watch = Callable[[str, float], None]


class Player:
    """``Source`` of snapshots of a run; it starts unpaused.

    ``span`` is the time of the first and of the last sample (s after the goal event).
    """

    def __init__(
        self, scene: Scene, motion: Motion, records: Sequence[Record], plan_times: Plans | None
    ) -> None:
        self.scene, self._motion, self._records = scene, motion, records
        self.span: tuple[float, float] = float(motion.time_s[0]), float(motion.time_s[-1])
        self.begin = ViewCommands(speed=1.0)
        self.hint = ""
        self._spent = [_of(plan_times, system) for system in scene.systems]
        self._commands = self.begin
        # Playing starts 1 s before the goal event: until then the vehicles only take off.
        self._at = min(max(self.span[0], -1.0), self.span[1])
        self._wall: float | None = None
        self._sent: float | None = None
        self._sought = True

    def poll(self, wall: float) -> Sequence[Scene | Snapshot]:
        """Return what is to be shown from wall time ``wall`` (s) on.

        That is the scene in the first call; the snapshots of the trails after a jump; the present snapshot if
        its time has changed.
        """
        found: list[Scene | Snapshot] = []
        if self._wall is None:
            found.append(self.scene)
            self._wall = wall
        speed = FAST if self._commands.speed is None else self._commands.speed
        if not self._commands.paused:
            self._at = min(self._at + speed * (wall - self._wall), self.span[1])
        self._wall = wall
        if self._sought:
            self._sought = False
            times = np.arange(max(self._at - PAST, self.span[0]), self._at, PAST_EVERY)
            found += [self.moment(time) for time in times.tolist()]
            self._sent = None
        if self._sent != self._at:
            self._sent = self._at
            found.append(self.moment(self._at))
        return found

    def command(self, commands: ViewCommands, sought: float | None) -> None:
        """Apply pause, steps and speed, and jump to the time ``sought``."""
        if commands.paused and commands.steps > self._commands.steps:
            self._at = min(self._at + _STEP * (commands.steps - self._commands.steps), self.span[1])
        self._commands = commands
        if sought is not None:
            self._at = min(max(sought, self.span[0]), self.span[1])
            self._sought = True

    def moment(self, time: float) -> Snapshot:
        """Return the snapshot at ``time`` (s after the goal event).

        It has the last sample at or before that time (or the first one) and the data of the logs.
        """
        motion = self._motion
        # A time in s is not always exactly that of its sample.
        row = max(int(np.searchsorted(motion.time_s, time + _ROUNDING_S, side="right")) - 1, 0)
        now = int(motion.time[row])
        return Snapshot(
            time,
            "before the goal" if time < 0.0 else "run",
            motion.position[row],
            np.array([self._attitude(row, k, now) for k in range(len(self.scene.systems))], np.float32),
            np.array([one.plan(now) for one in self._records]),
            motion.target[row],
            motion.moving[row],
            tuple(self._state(k, time, now) for k in range(len(self.scene.systems))),
            np.array([one.view(now) for one in self._records]),
            float(motion.separation[row]),
        )

    def _attitude(self, row: int, k: int, now: int) -> np.ndarray:
        """Return the attitude reported by the autopilot, or an upright attitude with the true yaw."""
        sent = self._records[k].attitude(now)
        if sent is not None:
            return sent
        half = 0.5 * float(self._motion.yaw[row, k])
        return np.array([np.cos(half), 0.0, 0.0, np.sin(half)])

    def _state(self, k: int, time: float, now: int) -> State:
        record, (times, spent) = self._records[k], self._spent[k]
        index = int(np.searchsorted(times, time, side="right")) - 1
        return State(record.mode(now), record.age(now), spent[index] if index >= 0 else nan)


def load(directory: Path, watch: Watch = lambda _what, _share: None) -> Player:
    """Load the run in ``directory``.

    Raises InputError if the directory holds no run, or a run that was stopped before its motion was written.
    """
    run = read(directory, "tlog:{}")
    if run.scenario is None or run.motion is None or not len(run.motion.time_s):
        wrong = "holds no flight.npz: it was stopped; allowed: a run that came to its end, or tlog:PATH"
        raise InputError(Fault(str(directory), wrong))
    scenario = run.scenario
    scene = staged(scenario, run.seed, airframe(scenario.vehicle), frozenset({"pace"}))
    paths = [directory / names.log(system) for system in scenario.systems]
    whole = max(sum(path.stat().st_size for path in paths if path.exists()), 1)
    origin, records, done = scenario.origin, [], 0
    frame = FleetFrame(origin.latitude, origin.longitude, origin.altitude)
    for system, path in zip(scenario.systems, paths, strict=True):

        def at(read_bytes: int, name: str = path.name, before: int = done) -> None:
            watch(name, (before + read_bytes) / whole)

        records.append(record(path, system, frame, at))
        done += path.stat().st_size if path.exists() else 0
    return Player(scene, run.motion, records, run.plan_times)


def _of(plans: Plans | None, system: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the times (s) and the durations (ms) of the plans of ``system``."""
    if plans is None:
        return np.empty(0), np.empty(0)
    own = plans.system == system
    order = np.argsort(plans.time_s[own], kind="stable")
    return plans.time_s[own][order], plans.value[own][order]
