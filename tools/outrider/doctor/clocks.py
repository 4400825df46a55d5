"""Comparison of the vehicle's clock with the receiver's."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from mavlink_bridge.messages import SystemTime
from outrider.doctor.case import Case
from outrider.doctor.finding import Finding, Severity

_RATE_TOLERANCE, _JITTER_S = 0.005, 0.1
"""The tolerance of the rate is the first value, a ratio, plus the second divided by the duration (s).

The second value (s) allows for jitter of the messages' delay.
"""
_MAX_SLIGHT_DEVIATION: Final = 0.2
"""Deviation of the rate from 1 from which on the vehicle counts as a simulation not in real time."""


def clock(case: Case) -> Iterator[Finding]:
    """Yield findings on the rate and the steps of time_boot, and on the date."""
    ticking = case.vehicle.clock
    if ticking.restarts and not ticking.doubled:
        yield Finding(
            f"its clock went back, {ticking.restarts} times: it was started again"
            if ticking.restarts > 1
            else "its clock went back: it was started again",
            Severity.NOTE if case.log else Severity.WARNING,
            "Origin, home and mode are new after that; a companion begins from the beginning.",
            "" if case.log else "See that its supply is steady.",
        )
    if ticking.leaps:
        yield Finding(
            f"its clock jumped ahead, {ticking.leaps} times",
            Severity.WARNING,
            "Positions have its time stamps: they appear newer or older than they are.",
            "Find the cause; in a simulation, for example, the computer slept.",
        )
    rate = ticking.rate
    if rate is None:
        if not ticking.stamps:
            yield Finding(
                "none of its messages has a time stamp",
                Severity.WARNING,
                "The age of its positions is unknown.",
                "Request ATTITUDE.",
            )
        return
    what = f"its clock runs {rate:.3f} times as fast as here"
    if abs(rate - 1.0) <= _RATE_TOLERANCE + _JITTER_S / ticking.seconds:
        yield Finding(what, Severity.OK, "Its seconds are ours.")
    elif abs(rate - 1.0) < _MAX_SLIGHT_DEVIATION:
        yield Finding(
            what,
            Severity.NOTE,
            "A simulation slightly off real time, or a poor clock; companions use its time.",
        )
    else:
        yield Finding(
            what,
            Severity.NOTE,
            "A simulation not in real time. The rates given here are in its time; companions use it too.",
            "Expect message rates in that ratio, and see that the computer keeps up.",
        )
    unix = case.vehicle.latest(SystemTime)
    if unix is not None and not unix.unix_time:
        yield Finding(
            "it does not know the date", Severity.NOTE, "It gets the date from GPS; signing needs it."
        )
