"""A dry run that is fed by a log: what the companion would have sent, and what is wrong with it."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from companion.autopilots.known import profile_of
from companion.reception import AUTOPILOT
from mavlink_bridge.codec import Codec
from mavlink_bridge.errors import LogError
from mavlink_bridge.messages import Heartbeat
from mavlink_bridge.tlog import read_tlog
from outrider.aboard.gauge import gauge_for
from outrider.aboard.request import Request
from outrider.errors import InputError
from outrider.replaying.casting import Cast, survey
from outrider.replaying.findings import document_of, leave
from outrider.replaying.rehearsal import rehearse
from outrider.run_directories import new_directory
from outrider.saying import say
from outrider.share_progress import share_progress

_FAR = 20_000.0
"""m from the fleet origin: no flight of this fleet's."""
_HEARTBEAT = 0


def rehearsed(asked: Request, log: Path) -> int:
    """Go through the log as fast as that goes; the exit status: 0 all is well, 1 something is wrong with what
    would have been sent. InputError for a log without the vehicle, or from elsewhere."""
    config = asked.config
    fleet = config.origin.frame
    try:
        seen = survey(read_tlog(log), config.system, str(log))
        far = float((fleet.to_enu(*seen.place) ** 2).sum() ** 0.5)
        if far > _FAR:
            latitude, longitude, _ = seen.place
            raise InputError(
                f"origin in {asked.name}: is {far / 1000.0:.0f} km away from where vehicle {config.system} "
                f"is in {log}; allowed: one near {latitude:.5f}, {longitude:.5f}"
            )
        mask = _mask(log, config.system)
        target = config.target if config.target in seen.placed else None
        cast = Cast(config.system, None, target)
        with share_progress() as watch:

            def told(now: int, _read: int) -> None:
                watch(log.name, (now - seen.begin) / max(seen.end - seen.begin, 1))

            found = rehearse(config.settings, cast, seen, read_tlog(log), told, fleet)
    except LogError as error:
        raise InputError(f"--autopilot: {error}") from None
    gauge = gauge_for(config.settings.limits)
    for now, message in found.would:
        gauge.take(now, message)
    faults = gauge.faults(mask)
    document = {
        "system": config.system,
        "dry_run": True,
        "target": target,
        **document_of(found),
        "setpoint_faults": faults,
    }
    directory = new_directory(asked.out, f"fly-{config.system}-dry")
    leave(directory, f"{log.name} · vehicle {config.system}", found, document)
    if asked.as_json:
        sys.stdout.write(json.dumps({**document, "run_dir": str(directory)}) + "\n")
    whom = f"target {target}" if target is not None else "a target that stands where it began"
    say(f"{log.name}: {len(found.would)} set-points would have been sent, around {whom}")
    for words, steps in sorted(found.reasons.items(), key=lambda pair: -pair[1]):
        say(f"{steps * 0.01:8.2f} s without a set-point for want of {words}")
    for fault in faults:
        say(f"wrong: {fault}")
    say(str(directory))
    return 1 if faults else 0


def _mask(log: Path, system: int) -> int:
    """The type mask that the vehicle's autopilot takes. InputError where it is not known."""
    codec = Codec(
        lambda identifier, sender, component: (identifier, sender, component) == (0, system, AUTOPILOT)
    )
    for record in read_tlog(log):
        for message in codec.feed(record.frame):
            if isinstance(message, Heartbeat) and (profile := profile_of(message)) is not None:
                return profile.setpoint_mask
    raise InputError(f"{log}: vehicle {system} is no ArduPilot or PX4 there: no heartbeat says so")
