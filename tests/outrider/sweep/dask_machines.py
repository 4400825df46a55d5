"""A real Dask scheduler and its workers, each a process of its own, on the loopback interface."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from tests.outrider.sweep import runs as sweep_runs

PATIENCE_S = 120.0
HERE = str(Path(__file__).parents[3])
"""Root of the checkout, from which workers import `runs`."""


class Machines:
    """Use it as a context: it leaves no process behind. In ``folder`` the runs of `sweep_runs` keep count."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._processes: list[subprocess.Popen[bytes]] = []
        self.address = ""

    def __enter__(self) -> Machines:
        file = self._folder / "scheduler.json"
        options = ["--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(file)]
        self._start("scheduler", *options)
        self._wait(self.scheduler, lambda: file.is_file() and file.read_text().endswith("}"))
        self.address = json.loads(file.read_text())["address"]
        return self

    def __exit__(self, *_: object) -> None:
        for process in reversed(self._processes):
            self.kill(process)

    @property
    def scheduler(self) -> subprocess.Popen[bytes]:
        return self._processes[0]

    def worker(self, threads: int = 1, path: str = "", port: int = 0) -> subprocess.Popen[bytes]:
        """Start one. ``path``: where it finds modules before all others."""
        options = [self.address, "--nthreads", str(threads), "--no-nanny", "--no-dashboard"]
        options += ["--host", "127.0.0.1", "--worker-port", str(port), "--local-directory", str(self._folder)]
        process = self._start("worker", *options, path=path)
        self._wait(process, lambda: "Registered to" in self._said(process).read_text())
        return process

    def kill(self, process: subprocess.Popen[bytes]) -> None:
        process.send_signal(signal.SIGKILL)
        process.wait()

    def _wait(self, process: subprocess.Popen[bytes], there: Callable[[], bool]) -> None:
        """Until it is there; RuntimeError with its last words if that process ends before, or takes too
        long."""
        began = time.monotonic()
        while not there():
            if process.poll() is not None or time.monotonic() - began > PATIENCE_S:
                raise RuntimeError(f"Dask did not start: {self._said(process).read_text()[-2000:]}")
            time.sleep(0.05)

    def _said(self, process: subprocess.Popen[bytes]) -> Path:
        return self._folder / f"process-{self._processes.index(process)}.txt"

    def _start(self, *words: str, path: str = "") -> subprocess.Popen[bytes]:
        places = [place for place in (path, HERE, *sys.path) if place]
        environment = {
            **os.environ,
            "PYTHONPATH": os.pathsep.join(places),
            sweep_runs.FOLDER: str(self._folder),
        }
        command = [sys.executable, "-m", "dask", *words]
        with (self._folder / f"process-{len(self._processes)}.txt").open("wb") as said:
            process = subprocess.Popen(
                command, env=environment, cwd=self._folder, stdin=subprocess.DEVNULL, stdout=said, stderr=said
            )
        self._processes.append(process)
        return process
