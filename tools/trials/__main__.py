"""``python -m trials``: one trial, with a line for each act; exit status 1 if it was not passed."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from outrider.errors import OutriderError
from outrider.run_directories import new_directory
from outrider.saying import say
from trials.plan import FLAVOURS, Plan
from trials.progress import Progress
from trials.stage import Stage
from trials.story import play
from trials.verdict import verdict

SLOWEST, FASTEST = 0.2, 20.0


def main() -> int:
    """The exit status."""
    parser = argparse.ArgumentParser(prog="make trial ARGS=…", description=__doc__)
    parser.add_argument("--flavour", choices=FLAVOURS, default=FLAVOURS[0])
    parser.add_argument("--speed", type=float, default=10.0, help="of time, 1 to 10")
    parser.add_argument("--out", type=Path, help="a new directory for all files")
    asked = parser.parse_args()
    if not SLOWEST <= asked.speed <= FASTEST:
        parser.error(f"--speed {asked.speed:g}: allowed is {SLOWEST:g} to {FASTEST:g}")
    try:
        directory = new_directory(asked.out, f"trial-{asked.flavour}")
    except OutriderError as error:
        parser.error(str(error))
    try:
        found = trial(Plan(asked.flavour, asked.speed), directory)
    except KeyboardInterrupt:
        say("stopped")
        return 130
    except OutriderError as error:
        say(str(error))
        return 3
    print(json.dumps(found, indent=1))  # noqa: T201
    return 1 if found["faults"] else 0


def trial(plan: Plan, directory: Path) -> dict[str, Any]:
    """What came of it; a line for each act on standard error, and on a terminal the time."""
    trouble = None
    with Progress(plan) as progress:
        stage = Stage(plan, directory, progress)
        try:
            play(stage)
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
    """All events in one file, in the order of the trial's time, and all ways flown."""
    if stage.observer.ready:
        ways = {
            f"{name}_{system}": values
            for system, track in stage.tracks().items()
            for name, values in track._asdict().items()
        }
        np.savez_compressed(directory / "tracks.npz", allow_pickle=False, **ways)
    events = [
        {"vehicle": system, **event} for system, wingman in stage.wingmen.items() for event in wingman.events
    ]
    lines = [json.dumps(event) for event in sorted(events, key=lambda event: event["trial_s"])]
    (directory / "events.jsonl").write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
