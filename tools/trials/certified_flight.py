"""One flight of a trial of certified separation: its parts, stepped in one loop, and what happens to them."""

from __future__ import annotations

import os
import select
import signal
import time
from collections.abc import Callable
from contextlib import ExitStack
from math import inf
from pathlib import Path
from typing import Any, Final

import numpy as np
import yaml
from numpy.typing import NDArray
from pymavlink.dialects.v20 import all as mavlink

from companion.values.components import COMPONENT
from mavlink_bridge.clocks.clock import WallClock
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import CommandInt, Source
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.signing import Signing
from outrider.errors import OutriderError
from outrider.key_files import key_of, new_key
from trials.certified_plan import PROCESSES, STOP_S, CertifiedPlan
from trials.certified_vehicles import certified_vehicles
from trials.companion_ports import CompanionPorts
from trials.companion_process import CompanionProcess
from trials.station import listener

Array = NDArray[np.float64]
PATIENCE, START_PATIENCE = 90.0, 400.0
"""Wall times after which an expected event is given up (s): the first start may compile the planner."""
TURN_S: Final = 20.0
"""Time between two goals (s)."""
ARRIVED_M: Final = 1.5
"""Distance (m) within which a goal counts as reached."""
_GROUND: Final = Source(255, mavlink.MAV_COMP_ID_MISSIONPLANNER)


class CertifiedFlight:
    """One flight of ``plan``; all files are in ``directory``."""

    def __init__(self, plan: CertifiedPlan, directory: Path) -> None:
        self.plan, self.directory = plan, directory
        origin = plan.origin
        self.fleet = FleetFrame(origin["latitude"], origin["longitude"], origin["altitude"])
        key = directory / "fleet.key"
        self._signing: Signing | None = None
        options: list[str] = []
        if plan.signed:
            new_key(key)
            self._signing = Signing(key_of(key))
            self._signing.present(WallClock().now())
            options = [f"--signing-key={key}"]
        self._codec = Codec(None, self._signing)
        self.acts: list[str] = []
        self.reached: dict[int, int] = dict.fromkeys(plan.systems, 0)
        """Number of goals that each vehicle has reached."""
        self._turn = -1
        self._next_goals = 0.0
        self._there: set[int] = set()
        self._pending: list[tuple[float, Callable[[], None]]] = []
        self.struck = 0.0
        """Time (s) of the last act, on the observer's time."""
        self.hit: set[int] = set()
        """Vehicles whose companion was killed or stopped."""
        with ExitStack() as files:
            self._vehicles = certified_vehicles(plan, self.fleet, directory, self._signing, options)
            files.callback(self._vehicles.close)
            self.observer = self._vehicles.observer
            self._swarm = CompanionPorts(plan.systems, plan.loss, plan.random)
            files.callback(self._swarm.close)
            self._grounds = {}
            configs = plan.write(directory)
            self._errors: dict[int, dict[str, float]] = {}
            self._started: dict[int, int] = {}
            self.companions: dict[int, CompanionProcess] = {}
            for system in plan.systems:
                ground, endpoint = listener()
                files.callback(ground.close)
                self._grounds[system] = ground
                words = [
                    f"--autopilot={self._vehicles.endpoint(system)}",
                    f"--swarm={self._swarm.endpoint(system)}",
                    f"--ground={endpoint}",
                    f"--config={configs[system]}",
                    "--go",
                    *options,
                ]
                self._errors[system] = yaml.safe_load(configs[system].read_text())["clock_error"]
                self._started[system] = WallClock().now()
                companion = CompanionProcess(system, directory / f"vehicle-{system}", *words)
                files.callback(companion.close)
                self.companions[system] = companion
            self._files = files.pop_all()

    def fly(self) -> None:
        """Fly it. Raises OutriderError if an expected event does not come."""
        systems = self.plan.systems
        self._until(
            lambda: all(self._seen(s, "phase", "escort") for s in systems),
            "the escort of all",
            START_PATIENCE,
        )
        began = time.monotonic()
        self.struck = self.observer.latest
        if self.plan.victims:
            killed, stopped = self.plan.random.sample(list(systems), 2)
            self._at(self.plan.random.uniform(1.0, TURN_S), lambda: self._kill(killed))
            self._at(self.plan.random.uniform(1.0, TURN_S), lambda: self._stop(stopped))
        while (passed := time.monotonic() - began) < self.plan.seconds:
            if passed >= TURN_S * (self._turn + 1):
                self._turn += 1
                self._there.clear()
            self._send_goals()
            self._step()
        for companion in self.companions.values():
            if companion.process.poll() is None:
                companion.process.send_signal(signal.SIGTERM)
        self._until(
            lambda: all(c.process.poll() is not None for c in self.companions.values()), "the end of all"
        )

    def close(self) -> None:
        """End all parts."""
        self._files.close()

    def seconds(self, system: int, clock: Array) -> Array:
        """Return the observer's times (n,) s at which that companion's clock showed ``clock`` (n,), s."""
        begin, error = self._started[system], self._errors[system]
        passed = 1e6 * clock - 1e3 * error["offset_ms"] - begin
        return self.observer.seconds(begin + passed / (1.0 + 1e-6 * error["drift_ppm"]))

    def steered(self, system: int) -> tuple[float, float]:
        """Return the times (s) from which and until which the companion flew by committed plans first."""
        begin = inf
        for event in self.companions[system].events:
            if event["what"] == "phase" and (event["text"] == "escort" or begin < inf):
                if event["text"] != "escort":
                    return begin, event["trial_s"]
                begin = min(begin, event["trial_s"])
        return begin, inf

    def _at(self, seconds: float, act: Callable[[], None]) -> None:
        self._pending.append((time.monotonic() + seconds, act))

    def _kill(self, system: int) -> None:
        what = self.plan.random.choice(self.plan.victims)
        os.kill(self._process(system, what), signal.SIGKILL)
        self.struck = self.observer.latest
        self.hit.add(system)
        self.acts.append(f"{what} of vehicle {system} killed")

    def _stop(self, system: int) -> None:
        what = self.plan.random.choice(self.plan.victims)
        process = self._process(system, what)
        os.kill(process, signal.SIGSTOP)
        self.struck = self.observer.latest
        self.hit.add(system)
        self.acts.append(f"{what} of vehicle {system} stopped for {STOP_S:g} s")
        self._at(STOP_S, lambda: os.kill(process, signal.SIGCONT))

    def _process(self, system: int, what: str) -> int:
        """Return the process id of the companion's newest process of the kind ``what``."""
        companion = self.companions[system]
        if what == PROCESSES[1]:
            return companion.process.pid
        word = "flies" if what == PROCESSES[0] else "backup"
        texts = [event["text"] for event in companion.events if event["what"] == "process"]
        return int([text for text in texts if word in text][-1].rpartition(" ")[2])

    def _seen(self, system: int, what: str, text: str) -> bool:
        events = self.companions[system].events
        return any(event["what"] == what and text in event["text"] for event in events)

    def _send_goals(self) -> None:
        """Send each vehicle its goal again and again; note who has arrived."""
        if self._signing is not None:
            self._signing.present(WallClock().now())
        again = time.monotonic() >= self._next_goals
        if again:
            self._next_goals = time.monotonic() + 1.0
        for system in self.plan.systems:
            goal = self.plan.goal(system, self._turn)
            place = self.observer.place(system)
            near = place is not None and float(np.linalg.norm(place - goal)) < ARRIVED_M
            if near and system not in self._there:
                self._there.add(system)
                self.reached[system] += 1
            if not again:
                continue
            latitude, longitude, altitude = self.fleet.to_geodetic(goal)
            x, y = round(latitude * 1e7), round(longitude * 1e7)
            frame, number = mavlink.MAV_FRAME_GLOBAL_INT, mavlink.MAV_CMD_DO_REPOSITION
            order = CommandInt(
                _GROUND, system, COMPONENT, frame, number, (-1.0, 0.0, 0.0, float("nan")), x, y, altitude
            )
            self._grounds[system].send(self._codec.encode(order))

    def _until(self, is_so: Callable[[], bool], what: str, patience: float = PATIENCE) -> None:
        end = time.monotonic() + patience
        while not is_so():
            if time.monotonic() > end:
                raise OutriderError(f"it has not come: {what}")
            self._step()

    def _step(self) -> None:
        """Do one step of all parts, for 50 ms."""
        end = time.monotonic() + 0.05
        sockets: list[Any] = [*self._swarm.sockets, *self.observer.sockets]
        while (left := end - time.monotonic()) > 0.0:
            select.select(sockets, [], [], left)
            self._swarm.turn()
            self.observer.turn()
        for ground in self._grounds.values():
            ground.receive()
        for companion in self.companions.values():
            companion.look(self.observer.latest)
        now = time.monotonic()
        for entry in [entry for entry in self._pending if entry[0] <= now]:
            self._pending.remove(entry)
            entry[1]()
        self._vehicles.check()
