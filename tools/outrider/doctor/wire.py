"""State of the link: duplicate ids, copies, damage, refused frames, capacity."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from outrider.doctor.case import Case
from outrider.doctor.finding import Finding, Severity
from outrider.doctor.hearing import Hearing
from outrider.doctor.presence import listed

_MIN_REPORTED_SHARE: Final = 0.01
_MIN_COUNT: Final = 3
_MIN_DURATION_S: Final = 2.0
_FLY_BYTES_PER_S: Final = 2500.0
"""Bytes/s: LOCAL_POSITION_NED (40) at 50 Hz, ATTITUDE (40) at 10 Hz, and little else."""


def wire(case: Case) -> Iterator[Finding]:
    """Yield findings on the link: unique ids, refused and damaged frames, load."""
    yield from _shared_ids(case)
    if case.hearing.refused:
        yield Finding(
            f"{case.hearing.refused} frames were refused: {case.hearing.refusal}",
            Severity.WARNING,
            "A sender on the link does not have the key, repeats earlier frames, or has a late clock.",
            "Give the key to all legitimate senders, and set their clocks; find out which others can send.",
        )
    yield from _damage(case.hearing)
    yield from _load(case)


def _shared_ids(case: Case) -> Iterator[Finding]:
    vehicle = case.vehicle
    number = vehicle.source.system
    if vehicle.clock.doubled or len(vehicle.identities) > 1:
        yield Finding(
            f"two vehicles with the same system id {number}",
            Severity.BLOCKING,
            "Their positions are mixed, and both obey what is meant for one.",
            "Give each an id of its own: SYSID_THISMAV (ArduPilot), MAV_SYS_ID (PX4), then restart it.",
        )
    others = [one for one in case.hearing.autopilots if one is not vehicle and one.source.system == number]
    if others:
        components = listed(sorted(one.source.component for one in [vehicle, *others]))
        yield Finding(
            f"{len(others) + 1} autopilots in system {number}: components {components}",
            Severity.WARNING,
            f"Only component {vehicle.source.component} was looked at; orders to the whole system reach all.",
            "Find out which component controls the vehicle.",
        )
    if number == 0:
        yield Finding(
            "the vehicle's system id is 0",
            Severity.BLOCKING,
            "Id 0 addresses all systems: no message can be addressed to this vehicle alone.",
            "Set SYSID_THISMAV (ArduPilot) or MAV_SYS_ID (PX4) to 1…250.",
        )
    if number == 255:
        yield Finding(
            "the vehicle's system id is 255",
            Severity.WARNING,
            "Ground stations use 255: each may take the other's messages for its own.",
            "Set SYSID_THISMAV (ArduPilot) or MAV_SYS_ID (PX4) to 1…250.",
        )
    if vehicle.repeated >= max(_MIN_COUNT, _MIN_REPORTED_SHARE * vehicle.frames):
        yield Finding(
            f"{vehicle.repeated} frames came twice",
            Severity.NOTE if case.log else Severity.WARNING,
            "Frames arrive over two routes, or in a loop. The doctor ignores copies, but they load the link.",
            "Look for an endpoint that is listed twice in the router's configuration.",
        )


def _damage(hearing: Hearing) -> Iterator[Finding]:
    share = hearing.bad / max(hearing.bad + hearing.frames, 1)
    if share > _MIN_REPORTED_SHARE and hearing.bad >= _MIN_COUNT:
        yield Finding(
            f"{share:.0%} of the frames are damaged ({hearing.bad})",
            Severity.WARNING,
            "A lost position or plan is missing until the next message; commands are repeated.",
            "Check cable, baud rate and the radio's distance; use flow control if the port has it.",
        )


def _load(case: Case) -> Iterator[Finding]:
    """Yield a finding on the load of a serial port, at ten bits per byte."""
    hearing = case.hearing
    if not case.baud or hearing.seconds < _MIN_DURATION_S:
        return
    rate = hearing.octets / hearing.seconds
    share = 10.0 * rate / case.baud
    room = case.baud / 10.0 - rate
    what = f"{rate / 1e3:.1f} kB/s of {case.baud / 1e4:.1f} ({share:.0%} of the port) are taken"
    if room < _FLY_BYTES_PER_S:
        yield Finding(
            what,
            Severity.WARNING,
            f"Position and attitude at the rates that fly asks for need {_FLY_BYTES_PER_S / 1e3:.1f} kB/s: "
            "messages will be late.",
            "Set 921600 baud (SERIALn_BAUD, SER_TEL1_BAUD), "
            "or reduce the autopilot's streams (SRn_…, MAV_n_MODE).",
        )
    else:
        yield Finding(what, Severity.OK, "There is room for what fly asks for.")
