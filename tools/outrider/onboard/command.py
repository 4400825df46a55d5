"""Command ``outrider fly``: opens the links, supervises one flight and reports the result."""

from __future__ import annotations

import json
import signal
import sys
import time
from contextlib import closing, nullcontext, suppress
from pathlib import Path
from typing import Final

from rich.console import Console

from mavlink_bridge.clocks.clock import WallClock
from outrider.errors import InputError
from outrider.interruption import ReceivedSignal, noted, suspending_signals_ignored
from outrider.onboard.event_log import EventLog
from outrider.onboard.figures import summary
from outrider.onboard.flight import Flight
from outrider.onboard.instance_lock import instance_lock
from outrider.onboard.line_input import typing
from outrider.onboard.request import Request
from outrider.onboard.screen import Screen
from outrider.onboard.terminal import Terminal
from outrider.onboard.wiring import Wiring, wire
from outrider.runs import names
from outrider.runs.configuration import write_fly_config
from outrider.runs.directories import new_directory
from outrider.terminal.lines import say

FAULT: Final = 3
"""Exit status of a flight that ended with a fault."""
_STOPS: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)


def run(asked: Request) -> int:
    """Fly until the vehicle has landed, a signal ends the program or the time limit has passed.

    Returns the exit status, ``FAULT`` after a fault. The signals are SIGINT, SIGTERM, SIGHUP and SIGQUIT; the
    operator's ``quit`` ends the flight too. If the request names a log, make a shadow run of it instead.
    Raises InputError if a link or file cannot be opened, if another process flies the vehicle, or if the
    autopilot is not the own vehicle's.
    """
    if asked.log is not None:
        from outrider.onboard.shadow_run import dry_run_of_log

        return dry_run_of_log(asked, asked.log)
    with nullcontext() if asked.dry_run else instance_lock(asked.system, asked.endpoints["autopilot"]):
        return _live(asked)


def _live(asked: Request) -> int:
    config, began = asked.config, time.monotonic()
    wiring = wire(asked.endpoints, config.system, config.target, config.settings, WallClock(), asked.key)
    with closing(wiring), noted(_STOPS) as stops, suspending_signals_ignored():
        directory = new_directory(asked.out, f"fly-{config.system}")
        try:
            write_fly_config(directory, config)
        except OSError as error:
            raise InputError(f"--out {directory}: cannot be written: {error.strerror}") from None
        with closing(EventLog(directory, lambda: time.monotonic() - began)) as event_log:
            flight = _flown(asked, directory, event_log, stops, wiring)
    found = summary(flight, directory)
    try:
        (directory / names.SUMMARY).write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    except OSError as error:
        with suppress(OSError):
            say(f"{directory / names.SUMMARY}: not written: {error.strerror}")
    with suppress(OSError):
        if asked.as_json:
            sys.stdout.write(json.dumps(found) + "\n")
            sys.stdout.flush()
        say(f"{'fault: ' if flight.fault else ''}{flight.ended}; {directory}")
    return FAULT if flight.fault else 0


def _flown(
    asked: Request, directory: Path, event_log: EventLog, stops: list[ReceivedSignal], wiring: Wiring
) -> Flight:
    """Fly with a live display on a terminal, otherwise with one line per event."""
    console = Console(stderr=True)
    with typing(console.is_terminal) as typed:
        if not console.is_terminal:
            event_log.tell = say
            flight = Flight(asked, wiring, directory, event_log, typed, stops, lambda: None)
            flight.run()
            return flight
        screen = Screen(terminal := Terminal(sys.stderr.fileno()))
        event_log.tell = screen.tell

        def look() -> None:
            screen.pending = typed.pending
            # A closed terminal must not end a flight.
            with suppress(OSError):
                screen.look()

        flight = screen.flight = Flight(asked, wiring, directory, event_log, typed, stops, look)
        screen.live.start()
        try:
            flight.run()
        finally:
            with suppress(OSError):
                screen.live.stop()
            terminal.close()
        return flight
