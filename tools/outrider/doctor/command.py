"""Command ``outrider doctor`` for a live link or a log."""

from __future__ import annotations

import json
import sys
from contextlib import closing
from pathlib import Path
from typing import Final

from mavlink_bridge.clocks.clock import Clock, WallClock
from mavlink_bridge.errors import EndpointError, LinkError, LogError
from mavlink_bridge.links.endpoints import Endpoint, Replay, Serial, parse_endpoint
from mavlink_bridge.links.link import Link, failure_of
from mavlink_bridge.links.opening import open_link
from mavlink_bridge.tlog.log import TlogReader
from mavlink_bridge.wire.framing import Frame, frame_at
from mavlink_bridge.wire.signing import Signing
from outrider.doctor.consultation import Consultation
from outrider.doctor.examination import Examination
from outrider.doctor.finding import Verdict
from outrider.doctor.page import document, show
from outrider.errors import InputError
from outrider.key_files import key_of
from outrider.logs.timeline import on_one_line
from outrider.terminal.share_progress import share_progress

READY, NOT_READY = 0, 1
_POLL_INTERVAL_US: Final = 20_000
"""Time between two polls of the link (µs)."""
_RECORDS_PER_REPORT: Final = 4096
"""Number of records between two progress reports."""


def doctor(endpoint: str, system: int | None, seconds: float, key: Path | None, as_json: bool) -> int:
    """Examine the vehicle at ``endpoint``, print the verdict, and return the exit status.

    It takes ``seconds`` at most, longer only for the reasons of a failing pre-arm check. ``key``: key file or
    None. Raises InputError for an endpoint or log that is invalid or cannot be opened, and an invalid key.
    """
    try:
        place = parse_endpoint(endpoint)
        if isinstance(place, Replay):
            if key is not None:
                raise InputError(f"doctor {endpoint}: --key is for live links; a log cannot be queried")
            verdict = of_log(place, system)
        else:
            verdict = _of_link(place, system, seconds, key)
    except (EndpointError, LinkError, LogError) as error:
        raise InputError(f"doctor {error}") from None
    if as_json:
        sys.stdout.write(json.dumps(document(verdict)) + "\n")
    else:
        show(endpoint, verdict)
    return READY if verdict.ready else NOT_READY


def of_log(place: Replay, system: int | None) -> Verdict:
    """Return the verdict on a whole log. Raises LogError if it cannot be read or has no MAVLink frame."""
    path = Path(place.path)
    if not path.is_file():
        raise LogError(
            f"{path}: {'is no file' if path.exists() else 'no such file'}; allowed: a .tlog, or a .tlog.gz"
        )
    reader, examination = TlogReader(path), Examination(system, log=True)
    hearing, size = examination.hearing, max(path.stat().st_size, 1)
    with share_progress() as watch:
        for number, (time, _, data) in enumerate(on_one_line(reader)):
            frame = frame_at(data, 0)
            if isinstance(frame, Frame):
                hearing.receive(time, frame)
            if number % _RECORDS_PER_REPORT == 0:
                watch(path.name, reader.bytes_read / size)
    hearing.bad, hearing.skipped_bytes = reader.report.bad, reader.report.skipped_bytes
    if not hearing.frames:
        raise LogError(f"{path}: holds no MAVLink frame; allowed: a .tlog, or a .tlog.gz")
    return examination.verdict()


def _of_link(place: Endpoint, system: int | None, seconds: float, key: Path | None) -> Verdict:
    clock = WallClock()
    signing = None if key is None else Signing(key_of(key))
    consultation = Consultation(round(seconds * 1e6), system, signing)
    consultation.examination.baud = place.baud if isinstance(place, Serial) else None
    with closing(open_link(place, clock)) as link:
        return consult(link, clock, consultation)


def consult(link: Link, clock: Clock, consultation: Consultation) -> Verdict:
    """Run ``consultation`` over ``link``, by ``clock``, until it is over; return the verdict."""
    now = clock.now()
    with share_progress() as watch:
        while not consultation.over(now):
            for data in consultation.step(now, link.receive()):
                link.send(data)
            watch(consultation.doing(now), consultation.share(now))
            clock.wait_until(now + _POLL_INTERVAL_US)
            now = clock.now()
        consultation.examination.hearing.failure = failure_of(link)
    return consultation.examination.verdict()
