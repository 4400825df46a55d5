"""Command ``python -m trials``: flies one trial, with a line per act; exit status 1 if it is not passed."""

from __future__ import annotations

import argparse
import json
import signal
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from outrider.errors import InputError, OutriderError
from outrider.runs.directories import new_directory
from outrider.scenarios.places import Origin
from outrider.terminal.lines import say
from trials.autopilots import add_option, autopilots
from trials.mishaps import ENDED, mishaps
from trials.plan import FLAVOURS, MISHAPS, SORTIE, STORIES, Plan
from trials.progress import Progress
from trials.separation import save
from trials.sortie import sortie
from trials.stage import Stage
from trials.verdict import verdict

SLOWEST, FASTEST, USUAL = 0.2, 20.0, 10.0
_TELLERS = {MISHAPS: mishaps, SORTIE: sortie}


def main(words: Sequence[str] | None = None) -> int:
    """Run the command with arguments ``words`` and return the exit status."""
    parser = argparse.ArgumentParser(prog="make trial ARGS=…", description=__doc__)
    parser.add_argument(
        "--story",
        choices=STORIES,
        help="mishaps, or sortie: separation and tracking (with --autopilots)",
    )
    parser.add_argument("--flavour", choices=FLAVOURS, help="of the emulated vehicles; ardupilot if not said")
    parser.add_argument(
        "--speed", type=float, help="of emulated time; 10 if not said, for a sortie and real firmware 1"
    )
    add_option(parser)
    parser.add_argument("--origin", help="LATITUDE,LONGITUDE,ALTITUDE of the first vehicle")
    parser.add_argument("--out", type=Path, help="a new directory for all files")
    asked = parser.parse_args(words)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        plan = planned(asked.story, asked.flavour, asked.speed, asked.autopilots, asked.origin)
        directory = new_directory(asked.out, f"trial-{plan.story}")
        found = trial(plan, directory)
    except KeyboardInterrupt:
        say("stopped")
        return 130
    except OutriderError as error:
        say(str(error))
        return error.exit_status
    print(json.dumps(found, indent=1))  # noqa: T201
    return 1 if found["faults"] else 0


def planned(
    story: str | None,
    flavour: str | None,
    speed: float | None,
    texts: Sequence[str],
    origin: str | None,
) -> Plan:
    """Return the plan that the options describe. Raises InputError for options that exclude each other."""
    flown = autopilots(texts) if texts else ()
    story = story or (SORTIE if flown else MISHAPS)
    if flown and flavour is not None:
        raise InputError("--flavour is of emulated vehicles: with --autopilots each says what it is")
    if flown and speed not in (None, 1.0):
        raise InputError(f"--speed {speed:g}: real firmware is flown at 1, the speed of the wall")
    if speed is None:
        speed = USUAL if story == MISHAPS and not flown else 1.0
    if not SLOWEST <= speed <= FASTEST:
        raise InputError(f"--speed {speed:g}: allowed is {SLOWEST:g} to {FASTEST:g}")
    plan = Plan(flavour or FLAVOURS[0], speed, story, flown, None if origin is None else _origin(origin))
    if story == MISHAPS and ENDED not in plan.systems:
        raise InputError(f"--story {MISHAPS} happens to vehicles up to {ENDED}: name at least so many")
    return plan


def _origin(text: str) -> Origin:
    names = ("latitude", "longitude", "altitude")
    try:
        numbers = [float(part) for part in text.split(",")]
        return Origin.model_validate(dict(zip(names, numbers, strict=True)))
    except (ValueError, ValidationError):
        raise InputError(
            f"--origin {text}: allowed is LATITUDE,LONGITUDE,ALTITUDE, ±89 and ±180 degrees, −500 to 9000 m"
        ) from None


def trial(plan: Plan, directory: Path) -> dict[str, Any]:
    """Fly the trial and return the verdict.

    Each act gives a line on standard error; a terminal also shows the time.
    """
    trouble = None
    with Progress(plan) as progress:
        stage = Stage(plan, directory, progress)
        try:
            _TELLERS[plan.story](stage)
        except OutriderError as error:
            trouble = str(error)
        finally:
            stage.close()
    found = verdict(stage, trouble)
    _keep(stage, directory)
    (directory / "trial.json").write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    say(f"{'not passed' if found['faults'] else 'passed'}; {directory}")
    return found


def _keep(stage: Stage, directory: Path) -> None:
    """Write all events to one file, in the order of the trial's time, and all tracks to another."""
    if stage.observer.ready:
        save(stage.observer.tracks(), directory)
    events = [
        {"vehicle": system, **event}
        for system, companion in stage.companions.items()
        for event in companion.events
    ]
    lines = [json.dumps(event) for event in sorted(events, key=lambda event: event["trial_s"])]
    (directory / "events.jsonl").write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
