"""Shadow run fed by a log: the set-points that the companion would have sent, and their faults."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from companion.flight.autopilots import Profile
from companion.flight.autopilots.known import KNOWN, profile_of
from mavlink_bridge.errors import LogError
from mavlink_bridge.messages import Heartbeat
from mavlink_bridge.tlog.log import read_tlog
from mavlink_bridge.wire.codec import Codec
from outrider.errors import InputError
from outrider.onboard.request import Request
from outrider.onboard.setpoint_check import setpoint_check
from outrider.onboard.trajectory_comparison import comparison
from outrider.runs.directories import new_directory
from outrider.shadow.findings import damage, damaged_records, document_of, leave
from outrider.shadow.roles import OwnRecords, Roles, survey
from outrider.shadow.shadow_run import ShadowRun, shadow_flight
from outrider.terminal.lines import say
from outrider.terminal.share_progress import share_progress

_MAX_DISTANCE_M: Final = 20_000.0
"""Maximum distance of the recorded vehicle from the fleet origin (m)."""


def dry_run_of_log(asked: Request, log: Path) -> int:
    """Replay the log at full speed and return the exit status: 1 for faulty or no set-points, otherwise 0.

    Raises InputError if the log is unreadable, or lacks the vehicle or its global position, or if the vehicle
    is far from the fleet origin, or its autopilot is unknown.
    """
    config = asked.config
    try:
        profile = _profile(asked, log, _autopilots(log))
        seen = survey(read_tlog(log), config.system, str(log))
        _check_origin(asked, log, seen)
        target = config.target if config.target in seen.placed else None
        with share_progress() as watch:

            def reported(now: int, _read: int) -> None:
                watch(log.name, (now - seen.begin) / max(seen.end - seen.begin, 1))

            reader = read_tlog(log)
            found = shadow_flight(
                config.settings,
                Roles(config.system, None, target),
                seen,
                reader,
                reported,
                config.origin.frame,
                follow=config.clock != "wall",
            )
            found.damaged = damaged_records(reader.report, found.records)
    except LogError as error:
        raise InputError(f"--autopilot: {error}") from None
    faults = _faults(asked, found, profile.setpoint_mask)
    near = comparison(found)
    document = {
        "system": config.system,
        "autopilot": profile.name,
        "dry_run": True,
        "target": target,
        **document_of(found),
        "beside_m": near.beside,
        "astray_m": near.astray,
        "setpoint_faults": faults,
    }
    directory = new_directory(asked.out, f"fly-{config.system}-dry")
    leave(directory, f"{log.name} · vehicle {config.system}", found, document)
    if asked.as_json:
        sys.stdout.write(json.dumps({**document, "run_dir": str(directory)}) + "\n")
    whom = f"target {target}"
    if target is None:
        whom = f"a target below the vehicle's first position, as system {config.target} sends none"
    say(f"{log.name}: vehicle {config.system}, {profile.name}")
    if line := damage(log.name, found):
        say(line)
    say(f"{len(found.would)} set-points would have been sent, around {whom}")
    for words, steps in sorted(found.reasons.items(), key=lambda pair: -pair[1]):
        say(f"{steps * 0.01:8.2f} s without a set-point: lacking {words}")
    for fault in faults:
        say(f"wrong: {fault}")
    say(str(directory))
    return 1 if faults else 0


def _faults(asked: Request, found: ShadowRun, mask: int) -> list[str]:
    """Return the faults of the run's set-points as text; the autopilot expects type mask ``mask``."""
    if not found.would:
        return ["no set-point at all"]
    settings = asked.config.settings
    gauge = setpoint_check(settings.limits, settings.heading)
    for now, message in found.would:
        gauge.take(now, message)
    return gauge.faults(mask) + comparison(found).faults


def _autopilots(log: Path) -> dict[int, int]:
    """Return MAV_AUTOPILOT of each vehicle of the log, by system id."""
    beat = mavlink.MAVLINK_MSG_ID_HEARTBEAT, mavlink.MAV_COMP_ID_AUTOPILOT1
    codec = Codec(lambda identifier, _system, component: (identifier, component) == beat)
    found: dict[int, int] = {}
    for record in read_tlog(log):
        for message in codec.feed(record.frame):
            if isinstance(message, Heartbeat) and message.autopilot != mavlink.MAV_AUTOPILOT_INVALID:
                known = profile_of(message) is not None
                if known or message.source.system not in found:
                    found[message.source.system] = message.autopilot
    return found


def _profile(asked: Request, log: Path, autopilots: dict[int, int]) -> Profile:
    """Return the profile of the own vehicle.

    Raises InputError if it is absent or its autopilot is unknown. The message lists the vehicles of the log,
    and the supported ones among them.
    """
    system = asked.system
    profile = KNOWN.get(autopilots.get(system, mavlink.MAV_AUTOPILOT_INVALID))
    if profile is not None:
        return profile
    there = ", ".join(
        f"{one} ({KNOWN[kind].name if kind in KNOWN else f'autopilot {kind}'})"
        for one, kind in sorted(autopilots.items())
    )
    allowed = ", ".join(str(one) for one, kind in sorted(autopilots.items()) if kind in KNOWN)
    wrong = "is no ArduPilot or PX4" if system in autopilots else "is not in it"
    raise InputError(
        f"--autopilot tlog:{log}: vehicle {system} (of {asked.name}) {wrong}; "
        f"there: {there or 'no vehicle'}; "
        f"allowed: {f'--system {allowed}' if allowed else 'a log with an ArduPilot or PX4'}"
    )


def _check_origin(asked: Request, log: Path, seen: OwnRecords) -> None:
    system, (latitude, longitude, _) = asked.system, seen.place
    if not (latitude or longitude):
        raise InputError(
            f"--autopilot tlog:{log}: vehicle {system} never knows where on the globe it is "
            "(GLOBAL_POSITION_INT); allowed: a log of a flight with a position"
        )
    far = float((asked.config.origin.frame.to_enu(*seen.place) ** 2).sum() ** 0.5)
    if far > _MAX_DISTANCE_M:
        raise InputError(
            f"origin in {asked.name}: is {far / 1000.0:.0f} km away from where vehicle {system} is in {log}; "
            f"allowed: one near {latitude:.5f}, {longitude:.5f}, in a copy of the file"
        )
