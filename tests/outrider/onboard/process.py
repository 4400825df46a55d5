"""A process of ``outrider fly``, a target that circles, and what is seen of them."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.links.link import Link
from outrider.simulation.beacon import Beacon
from outrider.simulation.paths import Motion

HOST: Final = "127.0.0.1"
PATIENCE: Final = 60.0
"""s until a test gives up; what is waited for comes within seconds."""
FLEET: Final = FleetFrame(47.397742, 8.545594, 488.0)
ORBIT, TURN = 8.0, 0.1
"""m and rad/s of the target's circle."""
GUIDED: Final = {"ardupilot": 4, "px4": 6 << 16}
HELD: Final = {"ardupilot": 17, "px4": 4 << 16 | 3 << 24}


class Target:
    """Circles, and says so five times a second of a time ``speed`` times as fast as the ``clock``."""

    def __init__(self, link: Link, speed: float, clock: Callable[[], float]) -> None:
        self._link, self._speed, self._clock = link, speed, clock
        self._beacon = Beacon(100, "target", 5.0, FLEET)
        self._began = clock()

    def pump(self) -> None:
        """Say what is due."""
        t = (self._clock() - self._began) * self._speed
        if self._beacon.due(round(t * 1e6)):
            place = ORBIT * np.array([np.sin(TURN * t), np.cos(TURN * t) - 1.0, 0.0])
            velocity = ORBIT * TURN * np.array([np.cos(TURN * t), -np.sin(TURN * t), 0.0])
            for datagram in self._beacon.say(round(t * 1e6), Motion(place, velocity)):
                self._link.send(datagram.data)


class Flying(ABC):
    """A running ``outrider fly`` in ``directory``; ``program``: what runs it."""

    def __init__(
        self,
        directory: Path,
        *options: str,
        program: Sequence[str] = ("outrider",),
        hands: Sequence[int] = (),
    ) -> None:
        self.directory = directory / "run"
        command = [sys.executable, "-m", *program, "fly", "--json", f"--out={self.directory}", *options]
        self.process = subprocess.Popen(
            command,
            pass_fds=hands,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        self.pump: list[Callable[[], None]] = []

    @property
    def events(self) -> list[dict[str, Any]]:
        """The events in ``events.jsonl`` up to now, without a line that is not written to its end."""
        path = self.directory / "events.jsonl"
        if not path.exists():
            return []
        return [
            json.loads(line)
            for line in path.read_text(encoding="utf-8").splitlines(keepends=True)
            if line.endswith("\n")
        ]

    def until(self, is_so: Callable[[], object]) -> None:
        """Wait, and let the target speak meanwhile."""
        end = self.now() + PATIENCE
        while not is_so():
            assert self.now() < end, self.events
            assert self.process.poll() is None, self.process.communicate()
            self.rest()

    @abstractmethod
    def now(self) -> float:
        """s, of the clock by which this waits."""

    @abstractmethod
    def rest(self) -> None:
        """A moment, in which the target speaks."""

    def sees(self, what: str, text: str) -> None:
        """Wait for an event."""
        self.until(lambda: any(event["what"] == what and text in event["text"] for event in self.events))

    def wait(self, seconds: float) -> None:
        """Wait for ``seconds`` (s) of the clock."""
        end = self.now() + seconds
        self.until(lambda: self.now() > end)

    def order(self, word: str) -> None:
        """Write ``word`` and a new line to the standard input of the process."""
        assert self.process.stdin is not None
        self.process.stdin.write(f"{word}\n")
        self.process.stdin.flush()

    @property
    def pilot(self) -> int:
        """The process that flies."""
        last = [event["text"] for event in self.events if event["what"] == "process"][-1]
        return int(last.rpartition(" ")[2])

    def end(self, which: signal.Signals | None = None) -> tuple[int, dict[str, Any]]:
        """Wait for the end of the process, after the signal ``which`` if there is one.

        Return its exit status and its summary.
        """
        if which is not None:
            self.process.send_signal(which)
        end = self.now() + PATIENCE
        while self.process.poll() is None:
            assert self.now() < end, self.events
            self.rest()
        out, err = self.process.communicate()
        assert out, err
        return self.process.returncode, json.loads(out)


def is_gone(process: int) -> bool:
    """Whether there is no such process any more."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return True
    return False


def free_port() -> int:
    """Of UDP."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind((HOST, 0))
        return int(probe.getsockname()[1])
