"""Worker process: ``python -m outrider.sweep.worker MODULE:FUNCTION``.

Its first line on standard output is ``{"ready": pid}``, or ``{"cannot": reason}`` if it cannot import
FUNCTION. Then it reads one task per line on standard input, runs it and writes one result per line on
standard output, all in JSON. It ends when its input ends, even in the middle of a run: a worker never
outlives its sweep. Output of a run goes to standard error.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from queue import SimpleQueue
from threading import Thread
from typing import Any, BinaryIO

from outrider.sweep.tasks import Task

Run = Callable[[Task], dict[str, Any]]
"""Function that flies a task and returns its summary: values of JSON, the same for the same task."""
_MAX_CHARACTERS = 500
"""Length of the message of an error, at most."""


def resolve(name: str) -> Run:
    """Return the function that ``module:function`` names."""
    module, _, function = name.partition(":")
    found: Run = getattr(import_module(module), function)
    return found


def serve(run: Run, lines: SimpleQueue[bytes], out: BinaryIO) -> None:
    """Run one task after the other, without end."""
    _say(out, {"ready": os.getpid()})
    while True:
        task = Task(**json.loads(lines.get()))
        began = time.perf_counter()
        result: dict[str, Any]
        try:
            summary = run(task)
            # Checked here, not while it is sent: a summary that is not JSON is a fault of the run.
            json.dumps(summary, allow_nan=False)
            result = {"status": "done", "what": None, "summary": summary}
        except Exception as error:
            # No error in one run may stop the others; it is recorded with its location.
            result = {"status": "fault", "what": _words(error), "summary": None}
        _say(out, {**result, "wall_s": round(time.perf_counter() - began, 3)})


def main() -> None:
    """Run tasks until the input ends."""
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    lines: SimpleQueue[bytes] = SimpleQueue()
    try:
        run = resolve(sys.argv[1])
    except (ImportError, AttributeError) as error:
        _say(out, {"cannot": f"{type(error).__name__}: {error}"})
        sys.exit(3)
    Thread(target=_listen, args=(lines,), daemon=True).start()
    serve(run, lines, out)


def _listen(lines: SimpleQueue[bytes]) -> None:
    for line in sys.stdin.buffer:
        lines.put(line)
    os._exit(0)


def _say(out: BinaryIO, message: dict[str, Any]) -> None:
    try:
        out.write(json.dumps(message, allow_nan=False).encode() + b"\n")
        out.flush()
    except BrokenPipeError:
        os._exit(0)


def _words(error: Exception) -> str:
    """Describe the error in one line: its type, its message, and the place where it was raised."""
    place = error.__traceback__
    while place is not None and place.tb_next is not None:
        place = place.tb_next
    where = ""
    if place is not None:
        where = f" ({Path(place.tb_frame.f_code.co_filename).name}:{place.tb_lineno})"
    said = " ".join(str(error).split())
    return f"{type(error).__name__}: {said[:_MAX_CHARACTERS]}{where}"


if __name__ == "__main__":
    main()
