"""Command ``python -m trials.certified``: flies trials of certified separation, and judges true distances.

Each vehicle has an ``outrider fly`` of its own. It is emulated and follows set-points as its firmware does,
or it is a simulation of real firmware. In each flight all swap places several times, messages are lost,
clocks are wrong, a process of one companion is killed and one of another is stopped for three seconds. Exit
status 1 if a flight is not passed.
"""

from __future__ import annotations

import argparse
import json
import signal
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any, Final

from outrider.certify.reading import read
from outrider.certify.verdict import judge
from outrider.errors import InputError, OutriderError
from outrider.runs.directories import new_directory
from outrider.terminal.lines import say
from trials.autopilots import add_option, autopilots
from trials.certified_flight import CertifiedFlight
from trials.certified_plan import KINDS, PROCESSES, SIGMA, TUBE, CertifiedPlan
from trials.certified_tracking import certified_tracking, logs_of
from trials.pace import Pace, pace_of
from trials.separation import blind, longest_gap, nearest, save

GOES_ON_M: Final = 3.0
"""Distance (m) that each other vehicle has flown at least after a process was killed or stopped."""


SENSORS: Final = ("truth", "rtk", "gnss", "sih")


def flown(plan: CertifiedPlan, directory: Path) -> dict[str, Any]:
    """Fly ``plan`` and return its results; ``faults`` is empty if it is passed."""
    trouble = ""
    flight = CertifiedFlight(plan, directory)
    try:
        flight.fly()
    except OutriderError as error:
        trouble = str(error)
    finally:
        flight.close()
    faults = [trouble] if trouble else []
    tracks = flight.observer.tracks()
    save(tracks, directory)
    found = nearest(tracks) if tracks else []
    least = min(found, key=lambda one: one.distance, default=None)
    if least is None or len(tracks) < len(plan.systems):
        faults.append(f"true positions are known of vehicles {sorted(tracks)} only")
    elif not least.distance > plan.d_min:
        faults.append(f"vehicles {least.pair} came within {least.distance:.3f} m of each other")
    faults += blind(max(map(longest_gap, tracks.values()), default=0.0))
    try:
        verdict = judge(read(directory, lambda _name, _share: None))
        faults += [verdict.line(finding) for finding in verdict.findings]
        anchors = verdict.document()["anchors"]
        certified: dict[str, Any] = {"findings": len(verdict.findings), "anchors": anchors}
    except OutriderError as error:
        faults.append(str(error))
        certified = {}
    others = [system for system in plan.systems if system not in flight.hit]
    moved = {s: round(tracks[s].moved(flight.struck), 1) for s in others if s in tracks}
    if any(far < GOES_ON_M for far in moved.values()):
        faults.append(f"not all others have flown on: {moved}")
    document = {
        "kind": plan.name,
        "seed": plan.seed,
        "acts": flight.acts,
        "distance_m": round(plan.distance, 3),
        "least_m": None if least is None else round(least.distance, 3),
        "pair": None if least is None else least.pair,
        "off_plan_m": {
            system: certified_tracking(
                logs_of(directory, system),
                system,
                flight.fleet,
                tracks.get(system) if plan.autopilots else None,
                partial(flight.seconds, system),
                flight.steered(system),
            ).document
            for system in plan.systems
        },
        "pace": {system: pace.document for system in plan.systems if (pace := _pace(directory, system))},
        "reached": flight.reached,
        "others_moved_m": moved,
        "certify": certified,
        "faults": faults,
    }
    (directory / "trial.json").write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    return document


def _pace(directory: Path, system: int) -> Pace | None:
    return pace_of(logs_of(directory, system), system)


def planned(asked: argparse.Namespace) -> list[CertifiedPlan]:
    """Return the plan of each flight that the options ask for. Raises InputError for options in conflict."""
    flown = autopilots(asked.autopilots) if asked.autopilots else ()
    if flown and asked.signed:
        raise InputError("--signed: real firmware has no key of the trial; sign the emulation's links")
    return [
        CertifiedPlan(
            asked.kind,
            asked.count,
            seed,
            asked.loss,
            victims=tuple(asked.victims),
            tube=asked.tube,
            position_sigma=asked.sigma,
            sensors=asked.sensors,
            signed=asked.signed,
            autopilots=flown,
        )
        for seed in range(asked.seed, asked.seed + asked.flights)
    ]


def main(words: Sequence[str] | None = None) -> int:
    """Run the command with arguments ``words`` and return the exit status."""
    parser = argparse.ArgumentParser(prog="python -m trials.certified", description=__doc__)
    parser.add_argument("--kind", choices=KINDS, default=KINDS[0], help="the vehicles' autopilots")
    parser.add_argument("--count", type=int, default=5, help="number of vehicles, 2 to 10")
    parser.add_argument("--flights", type=int, default=1)
    parser.add_argument("--seed", type=int, default=1, help="of the first flight; the next has the next one")
    parser.add_argument("--loss", type=float, default=0.2, help="share of the swarm's messages that is lost")
    parser.add_argument("--signed", action="store_true", help="sign all links")
    parser.add_argument(
        "--victims",
        nargs="*",
        choices=PROCESSES,
        default=list(PROCESSES),
        help="none: nothing happens to any",
    )
    parser.add_argument("--tube", type=float, default=TUBE, help="largest tracking error allowed for, m")
    parser.add_argument("--sigma", type=float, default=SIGMA, help="σ of the position estimates, m")
    parser.add_argument(
        "--sensors",
        choices=SENSORS,
        default=SENSORS[0],
        help="error of emulated estimates; reported positions are judged",
    )
    add_option(parser)
    parser.add_argument("--out", type=Path, help="a new directory for all files")
    asked = parser.parse_args(words)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        plans = planned(asked)
        directory = new_directory(asked.out, f"trial-certified-{plans[0].name}")
    except OutriderError as error:
        say(str(error))
        return error.exit_status
    failed = 0
    for plan in plans:
        place = directory / f"seed-{plan.seed}"
        place.mkdir()
        found = flown(plan, place)
        failed += bool(found["faults"])
        say(json.dumps(found))
    say(f"{len(plans) - failed} of {len(plans)} passed; {directory}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
