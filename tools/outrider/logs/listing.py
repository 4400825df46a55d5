"""``outrider replay LOG --list``: the systems in a log, as a table or as JSON."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from stat import S_ISDIR, S_ISREG
from typing import Any

from mavlink_bridge.errors import LogError
from outrider.errors import Fault, InputError
from outrider.logs.census import Census, Vehicle
from outrider.logs.tables import show
from outrider.logs.tally import count
from outrider.logs.words import MILLION, enumerated, rates
from outrider.terminal.share_progress import share_progress

_ALLOWED = "allowed: a .tlog, or a .tlog.gz"


def listing(path: Path, as_json: bool = False) -> int:
    """Print the systems in the log at ``path``; return the exit status, which is 0.

    Raises InputError if ``path`` is no file, cannot be read, or holds no complete record.
    """
    _refuse_what_is_no_file(path)
    with share_progress() as watch:
        try:
            census = count(path, lambda share: watch(path.name, share))
        except LogError as error:
            raise InputError(str(error)) from None
    if census is None:
        raise InputError(Fault(str(path), f"holds no MAVLink frame; {_ALLOWED}"))
    if as_json:
        sys.stdout.write(json.dumps(document(census)) + "\n")
    else:
        show(path.name, census)
    return 0


def _refuse_what_is_no_file(path: Path) -> None:
    """Raise InputError if ``path`` is not a file: a device may never end, a pipe cannot be read twice."""
    try:
        mode = path.stat().st_mode
    except FileNotFoundError:
        wrong = "no such file"
    except (OSError, ValueError) as error:
        wrong = f"cannot be read: {error.strerror if isinstance(error, OSError) else error}"
    else:
        if S_ISREG(mode):
            return
        wrong = "is a directory" if S_ISDIR(mode) else "not a file"
    raise InputError(Fault(str(path), f"{wrong}; {_ALLOWED}"))


def document(census: Census) -> dict[str, Any]:
    """Return the census as values of JSON.

    ``good``, ``bad``, ``unknown`` count records as TlogReport does; ``skipped`` counts the bytes in no good
    or unknown record. Times are Unix time, s. A rate is the number of messages over the time from the
    vehicle's first to its last.
    """
    report = census.report
    return {
        "vehicles": [_vehicle(vehicle) for vehicle in census.vehicles],
        "good": report.good,
        "bad": report.bad,
        "unknown": report.unknown,
        "skipped": report.skipped_bytes,
        "truncated": report.truncated,
        "time_steps_back": report.time_steps_back,
        "start": census.start / MILLION,
        "end": census.end / MILLION,
        "duration_s": (census.end - census.start) / MILLION,
        "signed": census.signed > 0,
        "signed_messages": census.signed,
    }


def _vehicle(vehicle: Vehicle) -> dict[str, Any]:
    limit, number, longest = vehicle.gaps
    return {
        "system_id": vehicle.system,
        "components": list(vehicle.components),
        "type": enumerated("MAV_TYPE", vehicle.kind),
        "autopilot": enumerated("MAV_AUTOPILOT", vehicle.autopilot),
        "messages": vehicle.messages,
        "rate_hz": {name: _brief(hz) for name, hz in rates(vehicle).items()},
        "start": vehicle.first / MILLION,
        "end": vehicle.last / MILLION,
        "gaps": {
            "count": number,
            "longest_s": longest / MILLION,
            "longer_than_s": limit / MILLION,
        },
        "versions": list(vehicle.versions),
        "links": list(vehicle.links),
        "signed_messages": vehicle.signed,
    }


def _brief(rate: float) -> float:
    return float(f"{rate:.4g}")
