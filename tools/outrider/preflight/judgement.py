"""Judgement of the reports of all vehicles, and the fleet file that follows from them.

Each process judges the same reports, so all come to the same fleet file.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from math import ceil
from typing import Final

from pydantic import ValidationError

from companion.config import CompanionConfig
from companion.flight.autopilots.known import KNOWN
from mavlink_bridge.wire.preflight import Report
from outrider.preflight.clock_meter import WORST
from outrider.preflight.findings import Check, Result, Verdict
from outrider.scenarios.fleet_file import (
    LinkFigures,
    Measurement,
    VehicleFigures,
    distance_of,
    settings_of,
)
from outrider.scenarios.fly_config import FleetOrigin

_MOST_LOSS: Final = 0.6
"""Loss up to which flights were measured to converge in time (docs/certified-figures.md#antipodal-scenes)."""
_CLOCK_ROOM: Final = 1.25
"""Factor between the measured bound of a clock and the one that the fleet file allows."""
_CLOCK_STEP_US: Final = 1_000


def judge(
    own: Sequence[Check],
    reports: Mapping[int, Report],
    missing: Mapping[int, str],
    config: CompanionConfig,
    origin: FleetOrigin,
    seconds: float,
) -> Verdict:
    """Return the verdict on the fleet ``config.certified.fleet``.

    ``own``: checks of the own vehicle; ``reports``: of all vehicles, by system id; ``missing``: why there is
    no report of a vehicle. ``seconds``: duration of the measurement.
    """
    checks = [*own]
    checks += [Check(f"vehicle {system}", "report", Result.FAIL, why) for system, why in missing.items()]
    seen = {check.subject for check in own}
    for system, report in sorted(reports.items()):
        if f"vehicle {system}" not in seen:
            checks.append(_of_report(system, report))
        checks += _links(system, report)
    failed = any(check.result is Result.FAIL for check in checks)
    if failed:
        return Verdict(tuple(checks), None)
    found = _settings(config, reports)
    try:
        fleet = settings_of(found, origin, _measurement(reports, seconds))
    except ValidationError as error:
        # A figure that no setting allows, for example an accuracy of 6 m.
        words = "; ".join(f"{one['loc'][-1]}: {one['msg']}" for one in error.errors() if one["loc"])
        return Verdict((*checks, Check("fleet", "settings", Result.FAIL, words)), None)
    text = f"plans keep {distance_of(found):.2f} m for a d_min of {found.field.d_min:g} m"
    checks.append(Check("fleet", "distance", Result.PASS, text))
    return Verdict(tuple(checks), fleet)


def _of_report(system: int, report: Report) -> Check:
    figures = zip(("σ", "clock", "tube"), report.figures, ("m", "ms", "m"), strict=True)
    known = [(name, 1e-3 * figure, unit) for name, figure, unit in figures if figure is not None]
    text = ", ".join(f"{name} {figure:.{1 if unit == 'ms' else 2}f} {unit}" for name, figure, unit in known)
    text = text or "nothing is known"
    if report.figures[1] is not None and report.figures[1] > WORST:
        return Check(f"vehicle {system}", "report", Result.FAIL, f"{text}; allowed: {1e-3 * WORST:g} ms")
    if not report.passed:
        return Check(
            f"vehicle {system}", "report", Result.FAIL, f"does not pass, its own table says why; {text}"
        )
    return Check(f"vehicle {system}", "report", Result.PASS, text)


def _links(system: int, report: Report) -> Iterator[Check]:
    for peer, loss, jitter, round_trip in report.links:
        share = 1e-4 * loss
        text = f"{100.0 * share:.1f} % lost, jitter {0.1 * jitter:.1f} ms"
        text += "" if round_trip is None else f", round trip {0.1 * round_trip:.1f} ms"
        if share > _MOST_LOSS:
            text += f"; allowed: {100.0 * _MOST_LOSS:.0f} % lost"
        yield Check(f"{peer} → {system}", "link", Result.FAIL if share > _MOST_LOSS else Result.PASS, text)


def _settings(config: CompanionConfig, reports: Mapping[int, Report]) -> CompanionConfig:
    """Return the settings of the fleet: measured values where no vehicle's file states one."""
    field, certified = config.field, config.certified
    sigma, clock, tube = (_largest(reports, number) for number in range(3))
    if sigma is not None:
        field = field.model_copy(update={"position_sigma": _rounded_up(sigma)})
    if clock is not None:
        allowed = ceil(_CLOCK_ROOM * clock / _CLOCK_STEP_US) * _CLOCK_STEP_US
        certified = certified.model_copy(update={"clock_us": min(max(allowed, _CLOCK_STEP_US), WORST)})
    if tube is not None:
        # Without a measurement of all vehicles the setting covers the others.
        least = 0.0 if _all_known(reports, 2) else certified.tube
        certified = certified.model_copy(update={"tube": max(_rounded_up(tube), least)})
    return config.model_copy(update={"field": field, "certified": certified})


def _largest(reports: Mapping[int, Report], number: int) -> int | None:
    """Return the largest of these figures; None if a file states the setting, or without any."""
    if any(report.stated[number] for report in reports.values()):
        return None
    figures = (report.figures[number] for report in reports.values())
    return max((figure for figure in figures if figure is not None), default=None)


def _all_known(reports: Mapping[int, Report], number: int) -> bool:
    return all(report.figures[number] is not None for report in reports.values())


def _rounded_up(millimetres: int) -> float:
    """Return a length in m, rounded up to cm, at least 1 cm."""
    return max(-(-millimetres // 10), 1) / 100.0


def _measurement(reports: Mapping[int, Report], seconds: float) -> Measurement:
    last = max(report.utc for report in reports.values())
    settings = {"position_sigma": 0, "tube": 2}
    return Measurement(
        at=datetime.fromtimestamp(last, UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
        seconds=seconds,
        configured=tuple(name for name, number in settings.items() if not _all_known(reports, number)),
        vehicles=tuple(
            VehicleFigures(
                system=system,
                firmware=KNOWN[report.autopilot].name if report.autopilot in KNOWN else "unknown",
                position_sigma=_metres(report.figures[0]),
                clock_us=report.figures[1],
                tube=_metres(report.figures[2]),
            )
            for system, report in sorted(reports.items())
        ),
        links=tuple(
            LinkFigures(
                sender=peer,
                receiver=system,
                loss=round(1e-4 * loss, 4),
                jitter_ms=round(0.1 * jitter, 1),
                round_trip_ms=None if round_trip is None else round(0.1 * round_trip, 1),
            )
            for system, report in sorted(reports.items())
            for peer, loss, jitter, round_trip in sorted(report.links)
        ),
    )


def _metres(millimetres: int | None) -> float | None:
    return None if millimetres is None else round(1e-3 * millimetres, 3)
