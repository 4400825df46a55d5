"""Running ``outrider fly`` process."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import IO, Any


class CompanionProcess:
    """Companion process of vehicle ``system``, with its files below ``directory``.

    ``events`` are those that ``look`` has read.
    """

    def __init__(self, system: int, directory: Path, *options: str) -> None:
        self.system = system
        self.events: list[dict[str, Any]] = []
        directory.mkdir(parents=True)
        self._directory, self._options = directory, options
        self._lives = 0
        self._file: IO[str] | None = None
        self._rest = ""
        self.start()

    def start(self) -> None:
        """Start the process, or start it again after its end."""
        self._close()
        self._lives += 1
        self._out = self._directory / f"life-{self._lives}"
        self._said = self._directory / f"life-{self._lives}.json"
        command = [sys.executable, "-m", "outrider", "fly", "--json", f"--system={self.system}"]
        command += [f"--out={self._out}", *self._options]
        with self._said.open("wb") as out, self._said.with_suffix(".log").open("wb") as err:
            self.process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=out, stderr=err, process_group=0
            )

    def look(self, now: float) -> None:
        """Read the events up to ``now``, s of the trial."""
        path = self._out / "events.jsonl"
        if self._file is None:
            if not path.exists():
                return
            self._file = path.open(encoding="utf-8")
        self._rest += self._file.read()
        *lines, self._rest = self._rest.split("\n")
        self.events += [{"trial_s": round(now, 2), **json.loads(line)} for line in lines]

    def order(self, word: str) -> None:
        """Send an order as if it were typed."""
        if self.process.stdin is not None:
            self.process.stdin.write(f"{word}\n".encode())
            self.process.stdin.flush()

    @property
    def pilot(self) -> int:
        """Process id of the child that flies."""
        last = [event["text"] for event in self.events if event["what"] == "process"][-1]
        return int(last.rpartition(" ")[2])

    def kill_pilot(self) -> None:
        """Send SIGKILL to the process that flies."""
        os.kill(self.pilot, signal.SIGKILL)

    def kill(self) -> None:
        """Send SIGKILL to all its processes."""
        os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()

    @property
    def summary(self) -> dict[str, Any] | None:
        """Summary that it printed at its end; None before."""
        text = self._said.read_text(encoding="utf-8")
        return json.loads(text) if text.strip() else None

    @property
    def errors(self) -> str:
        """Standard error of the current run."""
        return self._said.with_suffix(".log").read_text(encoding="utf-8", errors="replace")

    def close(self) -> None:
        """Kill what still runs, and close the files."""
        if self.process.poll() is None:
            self.kill()
        self._close()

    def _close(self) -> None:
        if self._file is not None:
            self._file.close()
            self._file = None
        if self._lives and self.process.stdin is not None:
            self.process.stdin.close()
