"""Comparison of the vehicle's clock with this machine's."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from mavlink_bridge.messages import SystemTime
from outrider.doctor.case import Case
from outrider.doctor.finding import Finding, Severity

_RIGHT, _JITTER = 0.005, 0.1
"""Tolerance of the rate: a share, and an error (s) over the duration, as messages are late by that much."""
_SIMULATED: Final = 0.2


def clock(case: Case) -> Iterator[Finding]:
    """Yield findings on the rate and the steps of time_boot."""
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
            "Positions are dated by it: they look younger or older than they are.",
            "Find out what sets it; sleeping computers of simulations do.",
        )
    rate = ticking.rate
    if rate is None:
        if not ticking.stamps:
            yield Finding(
                "nothing that it says has a time",
                Severity.WARNING,
                "Positions cannot be dated.",
                "Ask for ATTITUDE.",
            )
        return
    what = f"its clock runs {rate:.3f} times as fast as here"
    if abs(rate - 1.0) <= _RIGHT + _JITTER / ticking.seconds:
        yield Finding(what, Severity.OK, "Its seconds are ours.")
    elif abs(rate - 1.0) < _SIMULATED:
        yield Finding(
            what,
            Severity.NOTE,
            "A simulation that does not quite keep up, or a poor clock; companions live by its time.",
        )
    else:
        yield Finding(
            what,
            Severity.NOTE,
            "A simulation at a speed of its own. Rates here are in its time; companions live by it too.",
            "Expect as many more messages a second, and see that the computer keeps up.",
        )
    unix = case.vehicle.latest(SystemTime)
    if unix is not None and not unix.unix_time:
        yield Finding("it does not know the date", Severity.NOTE, "It learns it from GPS; signing wants it.")
