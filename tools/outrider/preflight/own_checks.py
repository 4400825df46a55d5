"""Checks of the own vehicle, which only its own process can make."""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil, hypot
from typing import Final

from companion.config import CompanionConfig
from companion.flight.autopilots import Profile
from companion.flight.lowering import lowered
from outrider.preflight.autopilot import TIMEOUTS, AutopilotFigures
from outrider.preflight.findings import Check, Result
from outrider.preflight.tube import TrackingError
from outrider.scenarios.fleet_file import stated_at

SIGMA: Final = ("field", "position_sigma")
CLOCK: Final = ("certified", "clock_us")
TUBE: Final = ("certified", "tube")
_EXERCISED: Final = 0.8
"""Share of ``limits.u_max`` that the set-points of a flight must reach, for its tracking error to count."""
_IN_WIND: Final = "simulated: 0.1 m in calm air, in 5 m/s of wind 0.8 m (ArduPilot) and 2.1 m (PX4)"
"""Drifts of emulated autopilots (docs/certified-figures.md#take-off-and-landing)."""
_SHORT_TIMEOUT_S: Final = 0.5
"""Time-out (s) up to which a vehicle without set-points is still near its plan."""


def own_checks(
    system: int,
    config: CompanionConfig,
    autopilot: AutopilotFigures,
    clock: int | None,
    flown: TrackingError | None,
    drift: float | None,
    *,
    doubled: bool,
) -> Iterator[Check]:
    """Yield the checks of the vehicle ``system``.

    ``clock`` (µs): bound of its clock, None if unknown; ``flown``: its tracking error in a recorded flight,
    or alone; ``drift``: its largest distance (m) from its column in take-off and landing.
    """
    subject = f"vehicle {system}"

    def check(name: str, failed: bool, text: str) -> Check:
        return Check(subject, name, Result.FAIL if failed else Result.PASS, text)

    yield check("id", doubled, "another companion has this id" if doubled else "nobody else has it")
    profile = autopilot.profile
    if profile is None:
        yield check("autopilot", True, "no heartbeat of an ArduPilot or PX4")
        return
    yield check("autopilot", False, profile.name)
    yield check("position", bool(autopilot.trouble), autopilot.trouble or "reliable while it was measured")
    yield _sigma(subject, config, autopilot.sigma)
    yield _clock(subject, config, clock)
    yield _tube(subject, config, flown)
    yield _drift(subject, config, flown, drift)
    yield from _limits(subject, config, profile, autopilot)
    yield _timeout(subject, autopilot, TIMEOUTS[profile.autopilot])
    unread = [name for name in autopilot.unread if name not in TIMEOUTS.values()]
    if unread:
        text = f"not answered, stock values assumed: {', '.join(unread)}"
        yield Check(subject, "parameters", Result.NOTE, text)


def _limits(
    subject: str, config: CompanionConfig, profile: Profile, autopilot: AutopilotFigures
) -> Iterator[Check]:
    """Compare the limits of committed plans with those of the autopilot.

    They bound acceleration and speed on each axis, and with ``limits.j_max`` the jerk, which some firmware
    bounds.
    """
    limits = config.limits
    planned = limits.model_copy(update={"a_total": max(hypot(*limits.strongest[:2]), limits.strongest[2])})
    able = lowered(planned, profile, autopilot.parameters)
    jerk = [change for change in able.changes if change.startswith("j_max")]
    beyond = [able.lacking] if able.lacking else [change for change in able.changes if change not in jerk]
    if beyond:
        text = f"plans need more than the autopilot can follow: at most {'; '.join(beyond)}"
        yield Check(subject, "limits", Result.FAIL, text)
    else:
        yield Check(
            subject, "limits", Result.PASS, "the autopilot can follow speeds and accelerations of plans"
        )
    if jerk:
        bound = limits.j_max
        plans = "do not" if bound is None else f"do only to {max(bound[:2]):g} m/s³"
        text = f"the autopilot bounds it, plans {plans}; set limits.j_max: at most {jerk[0]}"
        yield Check(subject, "jerk", Result.NOTE, text)


def _sigma(subject: str, config: CompanionConfig, sigma: float | None) -> Check:
    stated = stated_at(config, SIGMA)
    if sigma is None:
        if stated:
            text = f"not reported; {stated[0]} m of the file counts, unconfirmed"
            return Check(subject, "accuracy", Result.NOTE, text)
        text = "neither receiver nor estimator reports it; needed: companion.field.position_sigma in the file"
        return Check(subject, "accuracy", Result.FAIL, text)
    if stated and sigma > stated[0]:
        text = f"σ {sigma:.2f} m is more than the position_sigma of the file, {stated[0]} m"
        return Check(subject, "accuracy", Result.FAIL, text)
    return Check(subject, "accuracy", Result.PASS, f"σ {sigma:.2f} m at most")


def _clock(subject: str, config: CompanionConfig, clock: int | None) -> Check:
    stated = stated_at(config, CLOCK)
    if clock is None:
        kind = config.certified.fleet_time
        why = "a source of fleet time is missing" if kind == "measured" else "a round trip is missing"
        return Check(subject, "clock", Result.FAIL, f"its error has no bound: {why}")
    limit = stated[0] if stated else 100_000
    text = f"within {1e-3 * clock:.1f} ms"
    if clock > limit:
        text += f", more than clock_us, {1e-3 * limit:g} ms"
    return Check(subject, "clock", Result.FAIL if clock > limit else Result.PASS, text)


def _tube(subject: str, config: CompanionConfig, flown: TrackingError | None) -> Check:
    tube = config.certified.tube
    if flown is None:
        return Check(
            subject,
            "tube",
            Result.NOTE,
            f"{tube:g} m counts, not measured; --fly or --flight LOG measures it",
        )
    text = f"{flown.largest:.2f} m beside the set-points at most, in {flown.seconds:.0f} s of flight"
    needed = _EXERCISED * max(config.limits.strongest[:2])
    if flown.acceleration < needed:
        text += f" that is too gentle: {flown.acceleration:.1f} m/s²; needed: {needed:.1f} m/s² at least"
        return Check(subject, "tube", Result.FAIL, text)
    if stated_at(config, TUBE) and flown.largest > tube:
        return Check(subject, "tube", Result.FAIL, f"{text}, more than certified.tube, {tube:g} m")
    return Check(subject, "tube", Result.PASS, text)


def _drift(subject: str, config: CompanionConfig, flown: TrackingError | None, drift: float | None) -> Check:
    """Compare the drift with what others allow for a column: ``certified.drift``, or the tube.

    The tube is that of the fleet file: the one that is stated, or measured.
    """
    allowed = config.certified.drift
    tube = config.certified.tube if flown is None or stated_at(config, TUBE) else flown.largest
    if drift is None:
        text = f"{allowed:g} m counts in take-off and landing, not measured; {_IN_WIND}; --fly measures it"
        return Check(subject, "drift", Result.NOTE, text)
    text = f"{drift:.2f} m from its column at most in take-off and landing, in the wind of today"
    if drift > max(allowed, tube):
        text += f"; more than certified.drift, {allowed:g} m: state {ceil(10.0 * drift) / 10.0:g} or more"
        return Check(subject, "drift", Result.FAIL, text)
    return Check(subject, "drift", Result.PASS, text)


def _timeout(subject: str, autopilot: AutopilotFigures, name: str) -> Check:
    value = autopilot.parameters.get(name)
    if value is None:
        return Check(subject, "time-out", Result.NOTE, f"{name} was not answered")
    text = f"{name} {value:g} s"
    if value <= _SHORT_TIMEOUT_S:
        return Check(subject, "time-out", Result.PASS, text)
    text += (
        ": if companion and backup node both stop, the vehicle leaves its plan for that long; set 0.5 or less"
    )
    return Check(subject, "time-out", Result.NOTE, text)
