"""MAVProxy as someone uses it at a terminal: lines typed in, lines read back. Of its output nothing is thrown
away, so that a test can look at every line."""

from __future__ import annotations

import os
import re
import subprocess
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Final, NamedTuple

PATIENCE: Final = 30.0
# Prompts carry no line end, so that they stand in the way of other text: "GUIDED> GUIDED> Got COMMAND_ACK…".
_PROMPT: Final = re.compile(r"[A-Z_]+> ?")


class Line(NamedTuple):
    """``at``: seconds since the start, ``text``: without prompts."""

    at: float
    text: str


class MavProxy:
    """A running MAVProxy, with the modules that it loads by itself and no window."""

    def __init__(self, python: Path, endpoint: str, folder: Path) -> None:
        """``folder`` becomes its home, for what it keeps: telemetry logs, parameters, lists."""
        self.lines: list[Line] = []
        self._began = time.monotonic()
        self._read = 0
        self._news = threading.Condition()
        self._process = subprocess.Popen(
            [python, python.parent / "mavproxy.py", f"--master={endpoint}", f"--state-basedir={folder}"],
            cwd=folder,
            env={**_bare(os.environ), "HOME": str(folder), "PYTHONUNBUFFERED": "1"},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
        )
        self._reader = threading.Thread(target=self._listen, daemon=True)
        self._reader.start()

    def __enter__(self) -> MavProxy:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def type(self, line: str) -> None:
        """One command."""
        assert self._process.stdin is not None
        self._process.stdin.write(line + "\n")
        self._process.stdin.flush()

    def expect(self, pattern: str, seconds: float = PATIENCE) -> re.Match[str]:
        """The next line that holds ``pattern``; what came before it has been read then. Fails with all of the
        output."""
        until = time.monotonic() + seconds
        with self._news:
            while True:
                while self._read < len(self.lines):
                    found = re.search(pattern, self.lines[self._read].text)
                    self._read += 1
                    if found:
                        return found
                left = until - time.monotonic()
                if left <= 0 or (self._process.poll() is not None and not self._reader.is_alive()):
                    said = "\n".join(f"{line.at:7.3f} {line.text}" for line in self.lines)
                    raise AssertionError(f"no {pattern!r} within {seconds:.0f} s in:\n{said}")
                self._news.wait(min(left, 0.1))

    def ask(self, line: str, pattern: str, seconds: float = PATIENCE) -> re.Match[str]:
        """Type, and expect."""
        self.type(line)
        return self.expect(pattern, seconds)

    def when(self, pattern: str) -> float:
        """When (s) the first line came that holds ``pattern``."""
        return next(line.at for line in self.lines if re.search(pattern, line.text))

    def close(self) -> None:
        """As at the end of the input; then by force."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        try:
            self._process.wait(10.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._reader.join()
        self._process.stdout.close()

    def _listen(self) -> None:
        assert self._process.stdout is not None
        for text in self._process.stdout:
            with self._news:
                at = time.monotonic() - self._began
                self.lines.append(Line(at, _PROMPT.sub("", text.rstrip()).strip()))
                self._news.notify_all()


def _bare(environment: Mapping[str, str]) -> dict[str, str]:
    """Without what would show it our packages."""
    return {key: value for key, value in environment.items() if not key.startswith(("PYTHON", "VIRTUAL"))}
