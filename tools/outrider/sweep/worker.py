"""A worker process: ``python -m outrider.sweep.worker MODULE:FUNCTION``.

Reads one task a line on standard input, runs it, writes one result a line on standard output; all in JSON. It
ends when its input ends, in the middle of a run too: a worker never outlives its sweep. What a run prints
goes to standard error.
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
"""Flies a task and returns its summary: values of JSON, the same for the same task."""
MOST_WORDS = 500


def resolve(name: str) -> Run:
    """The function that ``module:function`` names."""
    module, _, function = name.partition(":")
    found: Run = getattr(import_module(module), function)
    return found


def serve(run: Run, lines: SimpleQueue[bytes], out: BinaryIO) -> None:
    """Run one task after the other, for ever."""
    _say(out, {"ready": os.getpid()})
    while True:
        task = Task(**json.loads(lines.get()))
        began = time.perf_counter()
        result: dict[str, Any]
        try:
            summary = run(task)
            # Now, not while it is sent: what cannot be JSON is a fault of the run.
            json.dumps(summary, allow_nan=False)
            result = {"status": "done", "what": None, "summary": summary}
        except Exception as error:
            # Whatever goes wrong in one run must not cost the others; it is written down with its place.
            result = {"status": "fault", "what": _words(error), "summary": None}
        _say(out, {**result, "wall_s": round(time.perf_counter() - began, 3)})


def main() -> None:
    """Be a worker until the input ends."""
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
    """The error in a line: its type, its message, and where it was raised."""
    place = error.__traceback__
    while place is not None and place.tb_next is not None:
        place = place.tb_next
    where = ""
    if place is not None:
        where = f" ({Path(place.tb_frame.f_code.co_filename).name}:{place.tb_lineno})"
    said = " ".join(str(error).split())
    return f"{type(error).__name__}: {said[:MOST_WORDS]}{where}"


if __name__ == "__main__":
    main()
