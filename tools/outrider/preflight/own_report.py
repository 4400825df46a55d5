"""Report of the own vehicle to all others, as it follows from its checks and measurements."""

from __future__ import annotations

from math import ceil

from mavlink_bridge.wire.preflight import Report
from outrider.preflight.autopilot import AutopilotFigures
from outrider.preflight.findings import Check, Result
from outrider.preflight.own_checks import CLOCK, SIGMA, TUBE
from outrider.preflight.terms import Terms
from outrider.preflight.tube import TrackingError
from outrider.preflight.turns import Turns
from outrider.scenarios.fleet_file import stated_at

Figures = tuple[float | None, int | None, TrackingError | None]
"""σ of the position (m), bound of the clock (µs), and tracking error; None: unknown."""


def own_report(
    now: int, terms: Terms, fingerprint: int, autopilot: AutopilotFigures, figures: Figures, *, passed: bool
) -> Report:
    """Return the report at ``now`` (µs, UTC), without links; ``passed``: whether no check failed."""
    sigma, clock, flown = figures
    of_sigma, of_clock, of_tube = (bool(stated_at(terms.config, path)) for path in (SIGMA, CLOCK, TUBE))
    return Report(
        terms.run,
        fingerprint,
        passed,
        (of_sigma, of_clock, of_tube),
        0,
        1,
        0 if autopilot.profile is None else autopilot.profile.autopilot,
        now // 1_000_000,
        (
            None if sigma is None else _millimetres(sigma),
            None if clock is None else min(clock, 0xFFFFFFFF),
            None if flown is None else _millimetres(flown.largest),
        ),
        (),
    )


def flight_check(terms: Terms, turns: Turns | None) -> list[Check]:
    """Return the check of the flight alone, if there is something to say about it."""
    if turns is None or not turns.trouble or terms.fly is None:
        return []
    result = Result.NOTE if terms.fly.dry else Result.FAIL
    return [Check(f"vehicle {terms.system}", "flight", result, turns.trouble)]


def _millimetres(length: float) -> int:
    """Return ``length`` (m) in mm, rounded up, at most what two bytes hold."""
    return min(ceil(1e3 * length), 65_535)
