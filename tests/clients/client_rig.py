"""Client programs in environments of their own: run, heard, and ended whatever happens."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

import pytest

PROGRAMS: Final = Path(__file__).parent / "programs"
ENVIRONMENTS: Final = Path(__file__).parents[2] / ".venv" / "clients"
PATIENCE: Final = 240.0
"""s for a whole flight; on a machine that is not busy it takes a tenth of that."""


def available(client: str) -> bool:
    """Whether it can be flown: in CI always, so that it fails there if it cannot."""
    return client == "pymavlink" or _interpreter(client).exists() or bool(os.environ.get("CI"))


def python(client: str) -> Path:
    """The interpreter of a client's environment; pymavlink's is that of the tests. Where there is none, the
    test is skipped; in CI it fails."""
    if client == "pymavlink":
        return Path(sys.executable)
    found = _interpreter(client)
    if not found.exists():
        reason = f"no environment for {client}: run make .venv/clients/.made"
        if os.environ.get("CI"):
            pytest.fail(reason)
        pytest.skip(reason)
    return found


def _interpreter(client: str) -> Path:
    return ENVIRONMENTS / client / "bin" / "python"


class Flight:
    """What a client told, by ``what``; and all that it said besides."""

    def __init__(self, status: int, told: list[dict[str, Any]], errors: str) -> None:
        self.status, self.told, self.errors = status, told, errors

    def __getitem__(self, what: str) -> dict[str, Any]:
        """The only such line. Fails with everything if there is none."""
        found = self.every(what)
        assert len(found) == 1, self.report(f"{len(found)} lines {what!r}")
        return found[0]

    def every(self, what: str) -> list[dict[str, Any]]:
        """All such lines."""
        return [line for line in self.told if line["what"] == what]

    def report(self, fault: str) -> str:
        """For whoever has to find out why."""
        lines = "\n".join(json.dumps(line)[:500] for line in self.told)
        return f"{fault}; status {self.status}; it told:\n{lines}\nand said:\n{self.errors[-4000:]}"


class Client:
    """A program of ``PROGRAMS`` that has been started; it sees nothing of our packages."""

    def __init__(self, interpreter: Path, program: str, *words: str) -> None:
        kept = {key: value for key, value in os.environ.items() if not key.startswith(("PYTHON", "VIRTUAL"))}
        self._process = subprocess.Popen(
            [interpreter, PROGRAMS / program, *words],
            cwd=PROGRAMS,
            env=kept,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            errors="replace",
            # MAVSDK 3 starts a server, which must not outlive it.
            start_new_session=True,
        )

    def flight(self) -> Flight:
        """What it told until its end."""
        try:
            out, errors = self._process.communicate(timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            self.end()
            out, errors = self._process.communicate()
        self.end()
        # Libraries write their own lines there too.
        lines = [line for line in out.splitlines() if line.startswith('{"what"')]
        others = "\n".join(line for line in out.splitlines() if not line.startswith('{"what"'))
        return Flight(self._process.returncode, [json.loads(line) for line in lines], others + errors)

    def end(self) -> None:
        """The program, and what it has started."""
        with suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
