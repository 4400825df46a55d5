"""A process of ``outrider fly`` that takes turns with a vehicle and a target, and what is seen of it."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from tests.outrider.onboard.far_ends import Vehicle
from tests.outrider.onboard.turns import Conductor

HOST: Final = "127.0.0.1"
PATIENCE: Final = 60.0
"""s until a test gives up; what is waited for comes within seconds."""
ROUNDS = 100_000
"""Number of rests, each of 1 ms of wall time at least, in which a process ends that has closed its socket."""
GUIDED: Final = {"ardupilot": 4, "px4": 6 << 16}
HELD: Final = {"ardupilot": 17, "px4": 4 << 16 | 3 << 24}


class Flying:
    """A running ``outrider fly`` in ``directory``, by the clock of a ``conductor``, beside a ``vehicle``.

    ``program``: module that runs it, with the number of its socket to the conductor as first argument.
    ``pump``: what else is called at each step of the vehicle.
    """

    def __init__(
        self,
        directory: Path,
        conductor: Conductor,
        vehicle: Vehicle,
        *options: str,
        program: str = "tests.outrider.onboard.in_turns",
    ) -> None:
        self._conductor, self._vehicle, self._rounds = conductor, vehicle, 0
        self.directory = directory / "run"
        self.pump: list[Callable[[], None]] = []
        with conductor.admit() as end:
            words = (str(end.fileno()), "fly", "--json", f"--out={self.directory}", *options)
            self.process = subprocess.Popen(
                [sys.executable, "-m", program, *words],
                pass_fds=[end.fileno()],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                start_new_session=True,
            )

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
        """Let vehicle, target and process go on until ``is_so``, for PATIENCE (s) of the clock at most."""
        end = self.now() + PATIENCE
        while not is_so():
            assert self.now() < end, self.events
            assert self.process.poll() is None, self.process.communicate()
            self.rest()

    def now(self) -> float:
        """Return the time of the clock, s."""
        return self._conductor.now * 1e-6

    def rest(self) -> None:
        """Let the processes go on to the vehicle's next step, make this step, and let the target send.

        Without a process that has its socket the clock stands still: the process is about to end. It has
        ``ROUNDS`` calls of this method for it.
        """
        conductor, vehicle = self._conductor, self._vehicle
        if conductor.alone:
            self._rounds += 1
            assert self._rounds <= ROUNDS, f"the process closed its socket and goes on: {self.events}"
            time.sleep(0.001)
            return
        while conductor.now < vehicle.due and not conductor.alone:
            conductor.advance(vehicle.due)
        vehicle.step()
        for pump in self.pump:
            pump()

    def until_vehicle(self, is_so: Callable[[], object], beats: int) -> None:
        """Go on until ``is_so``, whether the process has ended or not, for ``beats`` HEARTBEATs at most."""
        most = len(self._vehicle.beats) + beats
        while not is_so():
            assert len(self._vehicle.beats) < most
            while self._conductor.now < self._vehicle.due:
                self._conductor.advance(self._vehicle.due)
            self._vehicle.step()

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
        """Number of the process that flies."""
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
    """Return whether there is no such process any more."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return True
    return False


def free_port() -> int:
    """Return the number of a free port of UDP."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind((HOST, 0))
        return int(probe.getsockname()[1])
