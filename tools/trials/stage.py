"""All parts of a trial, stepped in one loop."""

from __future__ import annotations

import select
import time
from collections.abc import Callable
from contextlib import ExitStack
from math import inf
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mavlink_bridge.frames import FleetFrame
from outrider.errors import OutriderError
from trials.companion_ports import CompanionPorts
from trials.companion_process import CompanionProcess
from trials.flown import Flown, flown
from trials.observer import Observer
from trials.plan import SORTIE, TARGET, Plan
from trials.progress import Progress
from trials.separation import Nearest, longest_gap, nearest
from trials.station import Station
from trials.vehicles import vehicles
from trials.walker import Circle, Walker, sortie_way

Array = NDArray[np.float64]

_TURN = 0.002
"""Longest time between two steps of the target (s)."""
_LOOK = 0.05
"""Time between two polls of the companions' events (s)."""
PATIENCE = 60.0
"""Wall time, and simulated time, after which an expected event is given up (s)."""


class Stage:
    """Parts of a trial of ``plan``; all files are in ``directory``."""

    def __init__(self, plan: Plan, directory: Path, progress: Progress) -> None:
        self.plan, self.directory = plan, directory
        self._progress = progress
        self._began = time.monotonic()
        self.ended = 0.0
        """Time at which it was closed (s)."""
        self._looked = 0.0
        self._target: list[tuple[float, float, float, float]] = []
        self.marks: dict[str, float] = {}
        """Times of the marks (s)."""
        origin = plan.settings(plan.flavour_of(1))["origin"]
        self.fleet = FleetFrame(origin["latitude"], origin["longitude"], origin["altitude"])
        with ExitStack() as files:
            self.vehicles = vehicles(plan, self.fleet, directory)
            files.callback(self.vehicles.close)
            self.observer: Observer = self.vehicles.observer
            self.station = Station(plan.systems)
            files.callback(self.station.link.close)
            self.swarm = CompanionPorts(plan.systems)
            files.callback(self.swarm.close)
            self.walker = Walker(self.fleet, sortie_way() if plan.story == SORTIE else Circle())
            files.callback(self.walker.close)
            configs = plan.write(directory)
            self.companions: dict[int, CompanionProcess] = {}
            for system in plan.systems:
                options = {
                    "autopilot": self.vehicles.endpoint(system),
                    "swarm": self.swarm.endpoint(system),
                    "target": self.walker.endpoint,
                    "ground": self.station.endpoint,
                    "config": str(configs[plan.flavour_of(system)]),
                }
                words = [f"--{name}={value}" for name, value in options.items()]
                companion = CompanionProcess(system, directory / f"vehicle-{system}", *words)
                files.callback(companion.close)
                self.companions[system] = companion
            self._files = files.pop_all()

    @property
    def now(self) -> float:
        """Time since the first vehicle booted, or since observation began (s).

        It is simulated time for the emulation, otherwise wall time.
        """
        return self.observer.latest

    def mark(self, name: str) -> None:
        """Record the mark ``name`` at the current time."""
        self.marks[name] = self.now

    def tell(self, act: str) -> None:
        """Report that an act begins."""
        self._progress.tell(self.now, act)

    def until(
        self, is_so: Callable[[], object], what: str | Callable[[], str], patience: float = PATIENCE
    ) -> None:
        """Step until ``is_so`` returns true. Raises OutriderError if it does not within ``patience`` s."""
        end, last = time.monotonic() + patience, self.now + patience
        while not is_so():
            self.vehicles.check()
            if time.monotonic() > end and self.now > last:
                raise OutriderError(f"it has not come: {what if isinstance(what, str) else what()}")
            self.turn()

    def wait(self, seconds: float) -> None:
        """Step for that many seconds of ``now``."""
        end = self.now + seconds
        while self.now < end:
            self.turn()

    def turn(self) -> None:
        """Do one step of all parts."""
        # Messages between companions are forwarded at once; the rest may wait until the next step.
        select.select(self.swarm.sockets, [], [], _TURN)
        self.swarm.turn()
        self.observer.turn()
        self.station.turn()
        self._walk()
        wall = time.monotonic()
        if wall - self._looked >= _LOOK:
            self._looked = wall
            for companion in self.companions.values():
                companion.look(self.now)
            self._progress.look(self.now)

    def _walk(self) -> None:
        if not self.observer.ready:
            return
        clock = self.observer.clock.now()
        self.walker.turn(clock)
        if not self._target or self.now > self._target[-1][0]:
            self._target.append((self.now, *self.walker.motion(clock).position.tolist()))

    def target(self, times: Array) -> Array:
        """Return the target's positions (n, 3) at ``times`` (n,)."""
        rows = np.array(self._target)
        return np.stack([np.interp(times, rows[:, 0], rows[:, k]) for k in (1, 2, 3)], axis=1)

    def nearest(self) -> tuple[list[Nearest], float]:
        """Return the least distances of all pairs, and the longest gap (s) in a flying vehicle's track."""
        tracks = self.observer.tracks()
        return nearest(tracks, (TARGET, self.target)), max(map(longest_gap, tracks.values()))

    def steered(self, system: int) -> tuple[float, float]:
        """Return the times (s) from which and until which the companion of ``system`` steered it."""
        phases = {
            event["text"]: event["trial_s"]
            for event in self.companions[system].events
            if event["what"] == "phase"
        }
        return phases.get("escort", inf), phases.get("land", inf)

    def flown(self, system: int) -> list[Flown]:
        """Return the flight of each log of that vehicle's companion."""
        boot = self.walker.boot

        def seconds(since_boot: Array) -> Array:
            return self.observer.seconds(boot + since_boot)

        logs = sorted((self.directory / f"vehicle-{system}").rglob(f"vehicle-{system}.tlog"))
        found = (flown(log, system, self.fleet, seconds) for log in logs)
        return [one for one in found if one is not None]

    @property
    def wall_s(self) -> float:
        """Wall time since the beginning (s)."""
        return time.monotonic() - self._began

    def close(self) -> None:
        """End all parts."""
        self.ended = self.now
        self._files.close()
