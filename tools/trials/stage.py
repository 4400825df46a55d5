"""All that a trial consists of, turned in one loop."""

from __future__ import annotations

import select
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mavlink_bridge.frames import FleetFrame
from outrider.errors import OutriderError
from trials.hub import Hub
from trials.observer import Observer
from trials.plan import TARGET, Plan
from trials.progress import Progress
from trials.separation import Nearest, Track, longest_gap, nearest
from trials.station import Station, listener
from trials.vehicles import Vehicles
from trials.walker import Walker
from trials.wingman import Wingman

_TURN = 0.002
"""s at most between two looks at the target."""
_LOOK = 0.05
"""s between two looks at what the companions have noted."""
PATIENCE = 60.0
"""s of the wall, and so many more of the simulation, until something that has not come is given up."""


class Stage:
    """For ``plan``, with all files in ``directory``."""

    def __init__(self, plan: Plan, directory: Path, progress: Progress) -> None:
        self.plan, self.directory = plan, directory
        self._progress = progress
        self._began = time.monotonic()
        self._looked = 0.0
        self._target: list[tuple[float, float, float, float]] = []
        origin = plan.settings()["origin"]
        self._fleet = FleetFrame(origin["latitude"], origin["longitude"], origin["altitude"])
        with ExitStack() as files:
            ear, told = listener()
            files.callback(ear.close)
            self.vehicles = Vehicles(plan, told, directory)
            files.callback(self.vehicles.close)
            self.observer = Observer(ear, plan.systems, self._fleet)
            self.station = Station(plan.systems)
            files.callback(self.station.link.close)
            self.swarm = Hub(plan.systems)
            files.callback(self.swarm.close)
            self.walker = Walker(self._fleet)
            files.callback(self.walker.close)
            config = plan.write(directory)
            self.wingmen: dict[int, Wingman] = {}
            for system in plan.systems:
                options = {
                    "autopilot": self.vehicles.endpoint(system),
                    "swarm": self.swarm.endpoint(system),
                    "target": self.walker.endpoint,
                    "ground": self.station.endpoint,
                    "config": str(config),
                }
                words = [f"--{name}={value}" for name, value in options.items()]
                wingman = Wingman(system, directory / f"vehicle-{system}", *words)
                files.callback(wingman.close)
                self.wingmen[system] = wingman
            self._files = files.pop_all()

    @property
    def now(self) -> float:
        """s of the simulation, since the first vehicle booted."""
        return self.observer.latest

    def tell(self, act: str) -> None:
        """An act begins."""
        self._progress.tell(self.now, act)

    def until(self, is_so: Callable[[], object], what: str) -> None:
        """Turn until then. OutriderError if it does not come."""
        end, last = time.monotonic() + PATIENCE, self.now + PATIENCE
        while not is_so():
            if time.monotonic() > end and self.now > last:
                raise OutriderError(f"it has not come: {what}")
            self.turn()

    def wait(self, seconds: float) -> None:
        """So long, of the simulation."""
        end = self.now + seconds
        while self.now < end:
            self.turn()

    def turn(self) -> None:
        """One round."""
        # What the companions say to each other is passed on at once; the rest may wait until the next round.
        select.select(self.swarm.sockets, [], [], _TURN)
        self.swarm.turn()
        self.observer.turn()
        self.station.turn()
        self._walk()
        wall = time.monotonic()
        if wall - self._looked >= _LOOK:
            self._looked = wall
            for wingman in self.wingmen.values():
                wingman.look(self.now)
            self._progress.look(self.now)

    def _walk(self) -> None:
        if not self.observer.ready:
            return
        clock = self.observer.clock.now()
        self.walker.turn(clock)
        if not self._target or self.now > self._target[-1][0]:
            self._target.append((self.now, *self.walker.motion(clock).position.tolist()))

    def tracks(self) -> dict[int, Track]:
        """Of the vehicles, s since the first of them booted."""
        begin = self.observer.begin
        return {system: Track(*one.track(begin)) for system, one in self.observer.seen.items()}

    def nearest(self) -> tuple[list[Nearest], float]:
        """Who came how near to whom; and the longest gap (s) of what is known of a flying vehicle."""
        tracks, rows = self.tracks(), np.array(self._target)

        def target(times: NDArray[np.float64]) -> NDArray[np.float64]:
            return np.stack([np.interp(times, rows[:, 0], rows[:, k]) for k in (1, 2, 3)], axis=1)

        return nearest(tracks, (TARGET, target)), max(map(longest_gap, tracks.values()))

    @property
    def wall_s(self) -> float:
        """Since the beginning."""
        return time.monotonic() - self._began

    def close(self) -> None:
        """End all of it."""
        self._files.close()
