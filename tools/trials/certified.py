"""Command ``python -m trials.certified``: flies trials of certified separation, and judges true distances.

Each vehicle is emulated, follows set-points as its firmware does, and has an ``outrider fly`` of its own. In
each flight all swap places several times, messages are lost, clocks are wrong, a process of one companion is
killed and one of another is stopped for three seconds. Exit status 1 if a flight is not passed.
"""

from __future__ import annotations

import argparse
import json
import os
import select
import signal
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final

import numpy as np
from pymavlink.dialects.v20 import all as mavlink

from companion.values.components import COMPONENT
from mavlink_bridge.clocks.clock import WallClock
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import CommandInt, Source
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.signing import Signing
from outrider.certify.reading import read
from outrider.certify.verdict import judge
from outrider.errors import OutriderError
from outrider.key_files import key_of, new_key
from outrider.runs.directories import new_directory
from outrider.terminal.lines import say
from trials.arrivals import Arrivals
from trials.certified_plan import KINDS, PROCESSES, STOP_S, CertifiedPlan
from trials.certified_vehicles import CertifiedVehicles
from trials.companion_ports import CompanionPorts
from trials.companion_process import CompanionProcess
from trials.station import listener

PATIENCE, START_PATIENCE = 90.0, 400.0
"""Wall times after which an expected event is given up (s): the first start may compile the planner."""
TURN_S: Final = 20.0
"""Time between two goals (s)."""
GOES_ON_M: Final = 3.0
"""Distance (m) that each other vehicle has flown at least after a process was killed or stopped."""
ARRIVED_M: Final = 1.5
"""Distance (m) within which a goal counts as reached."""
_GROUND: Final = Source(255, mavlink.MAV_COMP_ID_MISSIONPLANNER)


class CertifiedFlight:
    """One flight of ``plan``; all files are in ``directory``."""

    def __init__(self, plan: CertifiedPlan, directory: Path) -> None:
        self.plan, self.directory = plan, directory
        origin = plan.origin
        self._frame = FleetFrame(origin["latitude"], origin["longitude"], origin["altitude"])
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
        """Time (s) of the last act."""
        self.hit: set[int] = set()
        """Vehicles whose companion was killed or stopped."""
        with ExitStack() as files:
            receiver, told = listener()
            files.callback(receiver.close)
            self._vehicles = CertifiedVehicles(plan, told, directory, options)
            files.callback(self._vehicles.close)
            self.arrivals = Arrivals(receiver, plan.systems, self._frame, self._signing)
            self._swarm = CompanionPorts(plan.systems, plan.loss, plan.random)
            files.callback(self._swarm.close)
            self._grounds = {}
            configs = plan.write(directory)
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

    def _at(self, seconds: float, act: Callable[[], None]) -> None:
        self._pending.append((time.monotonic() + seconds, act))

    def _kill(self, system: int) -> None:
        what = self.plan.random.choice(self.plan.victims)
        os.kill(self._process(system, what), signal.SIGKILL)
        self.struck = time.monotonic()
        self.hit.add(system)
        self.acts.append(f"{what} of vehicle {system} killed")

    def _stop(self, system: int) -> None:
        what = self.plan.random.choice(self.plan.victims)
        process = self._process(system, what)
        os.kill(process, signal.SIGSTOP)
        self.struck = time.monotonic()
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
            place = self.arrivals.place(system)
            near = place is not None and float(np.linalg.norm(place - goal)) < ARRIVED_M
            if near and system not in self._there:
                self._there.add(system)
                self.reached[system] += 1
            if not again:
                continue
            latitude, longitude, altitude = self._frame.to_geodetic(goal)
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
        sockets: list[Any] = [*self._swarm.sockets, self.arrivals]
        while (left := end - time.monotonic()) > 0.0:
            select.select(sockets, [], [], left)
            self._swarm.turn()
            self.arrivals.turn(time.monotonic())
        for ground in self._grounds.values():
            ground.receive()
        for companion in self.companions.values():
            companion.look(time.monotonic())
        now = time.monotonic()
        for entry in [entry for entry in self._pending if entry[0] <= now]:
            self._pending.remove(entry)
            entry[1]()
        self._vehicles.check()


def flown(plan: CertifiedPlan, directory: Path) -> dict[str, Any]:
    """Fly ``plan`` and return its results; ``faults`` is empty if it is passed."""
    trouble = ""
    flight = CertifiedFlight(plan, directory)
    try:
        flight.fly()
    except OutriderError as error:
        trouble = str(error)
    finally:
        flight.close()
    faults = [trouble] if trouble else []
    least, pair = flight.arrivals.least()
    if not least > plan.d_min:
        faults.append(f"vehicles {pair} came within {least:.3f} m of each other")
    try:
        verdict = judge(read(directory, lambda _name, _share: None))
        faults += [verdict.line(finding) for finding in verdict.findings]
        anchors = verdict.document()["anchors"]
        certified: dict[str, Any] = {"findings": len(verdict.findings), "anchors": anchors}
    except OutriderError as error:
        faults.append(str(error))
        certified = {}
    others = [system for system in plan.systems if system not in flight.hit]
    moved = {system: round(flight.arrivals.moved(system, flight.struck), 1) for system in others}
    if any(far < GOES_ON_M for far in moved.values()):
        faults.append(f"not all others have flown on: {moved}")
    found = {
        "kind": plan.kind,
        "seed": plan.seed,
        "acts": flight.acts,
        "least_m": round(least, 3),
        "pair": pair,
        "reached": flight.reached,
        "others_moved_m": moved,
        "certify": certified,
        "faults": faults,
    }
    (directory / "trial.json").write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    return found


def main(words: Sequence[str] | None = None) -> int:
    """Run the command with arguments ``words`` and return the exit status."""
    parser = argparse.ArgumentParser(prog="python -m trials.certified", description=__doc__)
    parser.add_argument("--kind", choices=KINDS, default=KINDS[0], help="the vehicles' autopilots")
    parser.add_argument("--count", type=int, default=5, help="number of vehicles, 2 to 10")
    parser.add_argument("--flights", type=int, default=1)
    parser.add_argument("--seed", type=int, default=1, help="of the first flight; the next has the next one")
    parser.add_argument("--loss", type=float, default=0.2, help="share of the swarm's messages that is lost")
    parser.add_argument("--signed", action="store_true", help="sign all links")
    parser.add_argument("--victims", nargs="+", choices=PROCESSES, default=list(PROCESSES))
    parser.add_argument("--out", type=Path, help="a new directory for all files")
    asked = parser.parse_args(words)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    directory = new_directory(asked.out, f"trial-certified-{asked.kind}")
    failed = 0
    for seed in range(asked.seed, asked.seed + asked.flights):
        victims = tuple(asked.victims)
        plan = CertifiedPlan(asked.kind, asked.count, seed, asked.loss, victims=victims, signed=asked.signed)
        place = directory / f"seed-{seed}"
        place.mkdir()
        found = flown(plan, place)
        failed += bool(found["faults"])
        say(json.dumps(found))
    say(f"{asked.flights - failed} of {asked.flights} passed; {directory}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
