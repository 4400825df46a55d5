"""A vehicle of ``outrider sitl`` and the ``outrider fly`` that flies it, as processes, and what is seen of
them."""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, Final

import numpy as np

from mavlink_bridge.clocks.clock import WallClock
from mavlink_bridge.links.opening import open_link
from mavlink_bridge.messages import GlobalPosition, Heartbeat, Message, SysStatus
from mavlink_bridge.wire.codec import Codec
from tests.outrider.onboard.far_ends import FLEET
from tests.outrider.onboard.process import HOST
from tests.outrider.sitl_server.test_command import free_base
from tests.soak.switch import Switch

PACE: Final = 0.9
"""By its rate a clock is known for a simulation's, which stands now and then on a busy machine. At 1 it is
taken for a vehicle's, and what stood for slow: for a minute nothing of it is fresh."""


def resident(process: int) -> int | None:
    """Bytes in memory; None where nobody tells."""
    try:
        pages = Path(f"/proc/{process}/statm").read_text()
    except (OSError, ValueError):
        return None
    return int(pages.split()[1]) * resource.getpagesize()


def _bury(process: subprocess.Popen[str] | None) -> None:
    """Close the pipe to one that has ended."""
    if process is not None:
        process.communicate()


class Bird:
    """A vehicle, its companion's process, and an ear at another of the vehicle's ports. ``steady``: its
    process is left alone, so that its memory can be looked at for long."""

    def __init__(self, system: int, flavour: str, switch: Switch, directory: Path, *, steady: bool) -> None:
        self.system, self.flavour, self.switch, self.steady = system, flavour, switch, steady
        self.directory = directory
        self._port = switch.port(system)
        self._base = free_base(flavour, 1)
        self._codec = Codec()
        self.summaries: list[dict[str, Any]] = []
        self.lives = 0
        self.provoked = 0
        self.mode: int | None = None
        self.beats = 0
        self.place: tuple[float, np.ndarray] | None = None
        self.battery: float | None = None
        self.memory: dict[int, list[tuple[float, int]]] = {}
        self.flights = 0
        self.alone_until = 0.0
        self.events: list[dict[str, Any]] = []
        self._read = 0
        self._sitl: subprocess.Popen[str] | None = None
        self._fly: subprocess.Popen[str] | None = None

    # Processes

    def power_up(self) -> None:
        """A vehicle with a full battery on its pad."""
        _bury(self._sitl)
        directory = self.directory / f"sitl-{self.system}"
        directory.mkdir(exist_ok=True)
        origin = FLEET.to_geodetic(np.array([12.0 * self.system - 24.0, -14.0, 0.0]))
        self._sitl = self._start(
            directory,
            "sitl",
            "--json",
            f"--flavour={self.flavour}",
            f"--first-id={self.system}",
            f"--port-base={self._base}",
            f"--speedup={PACE}",
            f"--origin={origin[0]:.7f},{origin[1]:.7f},{FLEET.altitude}",
        )
        other = self._base + (2 if self.flavour == "ardupilot" else 10)
        kind = "tcp" if self.flavour == "ardupilot" else "udpin"
        self._ear = open_link(f"{kind}:{HOST}:{other}", WallClock())
        self.mode, self.beats, self.place, self.battery = None, 0, None, None

    def take_seat(self) -> None:
        """Start ``outrider fly``."""
        _bury(self._fly)
        self.lives += 1
        kind = "tcp" if self.flavour == "ardupilot" else "udpin"
        home = self.directory / f"fly-{self.system}-{self.lives}"
        home.mkdir()
        self.run = home / "run"
        self._read, self.events = 0, []
        self._fly = self._start(
            home,
            "fly",
            "--json",
            f"--out={self.run}",
            f"--autopilot={kind}:{HOST}:{self._base}",
            f"--swarm=udpout:{HOST}:{self._port}",
            f"--config={self.directory / 'companion.yaml'}",
            f"--system={self.system}",
        )

    def _start(self, directory: Path, *options: str) -> subprocess.Popen[str]:
        name = f"{options[0]}-{time.monotonic_ns()}"
        with (directory / f"{name}.out").open("w") as out, (directory / f"{name}.err").open("w") as err:
            return subprocess.Popen(
                [sys.executable, "-m", "outrider", *options],
                stdin=subprocess.PIPE,
                stdout=out,
                stderr=err,
                text=True,
                start_new_session=True,
            )

    @property
    def parent(self) -> subprocess.Popen[str]:
        assert self._fly is not None
        return self._fly

    @property
    def broken(self) -> str:
        """What a process said that should not have ended, or not so."""
        if self._fly is None or self._fly.poll() in (None, 0):
            return ""
        return sorted(self.run.parent.glob("fly-*.err"))[-1].read_text()

    @property
    def pilot(self) -> int:
        """The process that flies; IndexError before the first has told its number."""
        return self._pilots[-1]

    @property
    def _pilots(self) -> list[int]:
        """The processes that have flown, the present one last."""
        return [
            int(event["text"].rpartition(" ")[2])
            for event in self.events
            if event["what"] == "process" and "in process" in event["text"]
        ]

    def signal_sitl(self, which: signal.Signals) -> None:
        """To all its processes."""
        assert self._sitl is not None
        os.killpg(self._sitl.pid, which)

    def is_off(self) -> bool:
        """Whether the SITL has ended; then its ear is deaf."""
        assert self._sitl is not None
        if self._sitl.poll() is None:
            return False
        self._ear.close()
        return True

    def end(self) -> None:
        """Whatever still runs."""
        for process in (self._fly, self._sitl):
            if process is not None and process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
            _bury(process)
        self._ear.close()

    # What is seen and said

    def pump(self) -> None:
        """Hear the vehicle, read what its companion notes."""
        for data in self._ear.receive():
            for message in self._codec.feed(data, whole=True):
                if isinstance(message, Heartbeat) and message.autopilot != 8:
                    self.mode, self.beats = message.custom_mode, self.beats + 1
                elif isinstance(message, GlobalPosition):
                    place = FLEET.to_enu(message.latitude, message.longitude, message.altitude)
                    self.place = time.monotonic(), place
                elif isinstance(message, SysStatus):
                    self.battery = message.battery_remaining
        path = self.run / "events.jsonl" if self._fly is not None else None
        if path is not None and path.exists():
            with path.open(encoding="utf-8") as file:
                file.seek(self._read)
                for line in iter(file.readline, ""):
                    if line.endswith("\n"):
                        self.events.append(json.loads(line))
                        self._read = file.tell()

    def say(self, message: Message) -> None:
        """As a ground station."""
        self._ear.send(self._codec.encode(message))

    def order(self, word: str) -> None:
        """As typed."""
        assert self.parent.stdin is not None
        self.parent.stdin.write(f"{word}\n")
        self.parent.stdin.flush()

    def sees(self, what: str, text: str, since: int) -> bool:
        """Whether there is such an event after the first ``since``."""
        return any(event["what"] == what and text in event["text"] for event in self.events[since:])

    def is_concerned(self, text: str) -> bool:
        """Whether that is a concern now."""
        told = [event for event in self.events if event["what"] in ("concern", "over", "process")]
        told = [event for event in told if text in event["text"] or event["what"] == "process"]
        return bool(told) and told[-1]["what"] == "concern"

    @property
    def life(self) -> tuple[int, int]:
        """Another one: another process flies, or none does, and knows nobody yet."""
        return self.lives, sum(event["what"] in ("process", "lost", "phase") for event in self.events)

    @property
    def phase(self) -> str:
        phases = [event["text"] for event in self.events if event["what"] in ("phase", "lost")]
        return phases[-1] if phases else ""

    @property
    def waiting(self) -> str:
        waits = [event["text"] for event in self.events if event["what"] == "waiting"]
        return waits[-1] if waits else ""

    def weigh(self, seconds: float) -> None:
        """Note the memory of the parent, and of the process that flies if that has begun."""
        if self._fly is None or self.parent.poll() is not None:
            return
        for process in (self.parent.pid, *self._pilots[-1:]):
            size = resident(process)
            if size is not None:
                self.memory.setdefault(process, []).append((seconds, size))
