"""State of the link: duplicate ids, copies, damage, refused frames, capacity."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from outrider.doctor.case import Case
from outrider.doctor.finding import Finding, Severity
from outrider.doctor.hearing import Hearing
from outrider.doctor.presence import listed

_MANY_BAD: Final = 0.01
_SEVERAL: Final = 3
_LONG_ENOUGH: Final = 2.0
_WANTED: Final = 2500.0
"""Bytes/s: LOCAL_POSITION_NED (40) at 50 Hz, ATTITUDE (40) at 10 Hz, and little else."""


def wire(case: Case) -> Iterator[Finding]:
    """Yield findings on the link: unique ids, refused and damaged frames, load."""
    yield from _shared_ids(case)
    if case.hearing.refused:
        yield Finding(
            f"{case.hearing.refused} frames do not count: {case.hearing.refusal}",
            Severity.WARNING,
            "Somebody on the link has not the key, or says again what was said before.",
            "Give the key to all who belong here; find out who else can send.",
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
            "An escort talks to component 1 only. See which of them flies the vehicle.",
        )
    if number == 0:
        yield Finding(
            "the vehicle's system id is 0",
            Severity.BLOCKING,
            "That means everybody: nothing can be addressed to it.",
            "Set SYSID_THISMAV (ArduPilot) or MAV_SYS_ID (PX4) to 1…250.",
        )
    if number == 255:
        yield Finding(
            "the vehicle's system id is 255",
            Severity.WARNING,
            "That is what ground stations take: each may think that the other is itself.",
            "Set SYSID_THISMAV (ArduPilot) or MAV_SYS_ID (PX4) to 1…250.",
        )
    if vehicle.repeated >= max(_SEVERAL, _MANY_BAD * vehicle.frames):
        yield Finding(
            f"{vehicle.repeated} frames came twice",
            Severity.NOTE if case.log else Severity.WARNING,
            "There are two ways to here, or a loop. Copies are left out here, but take room on a radio.",
            "Look for an endpoint that stands twice in the router's configuration.",
        )


def _damage(hearing: Hearing) -> Iterator[Finding]:
    share = hearing.bad / max(hearing.bad + hearing.frames, 1)
    if share > _MANY_BAD and hearing.bad >= _SEVERAL:
        yield Finding(
            f"{share:.0%} of the frames are damaged ({hearing.bad})",
            Severity.WARNING,
            "What is lost is not sent again: a plan, a position, an order may be among it.",
            "Check cable, baud rate and the radio's distance; use flow control where there is some.",
        )


def _load(case: Case) -> Iterator[Finding]:
    """Yield a finding on the load of a serial port, at ten bits per byte."""
    hearing = case.hearing
    if not case.baud or hearing.seconds < _LONG_ENOUGH:
        return
    rate = hearing.octets / hearing.seconds
    share = 10.0 * rate / case.baud
    room = case.baud / 10.0 - rate
    what = f"{rate / 1e3:.1f} kB/s of {case.baud / 1e4:.1f} ({share:.0%} of the port) are taken"
    if room < _WANTED:
        yield Finding(
            what,
            Severity.WARNING,
            f"Position and attitude as fly asks for them take {_WANTED / 1e3:.1f} kB/s more: messages "
            "will be late.",
            "Set 921600 baud (SERIALn_BAUD, SER_TEL1_BAUD), or have less streamed there (SRn_…, MAV_n_MODE).",
        )
    else:
        yield Finding(what, Severity.OK, "There is room for what fly asks for.")
