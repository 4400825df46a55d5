"""Judgement of the reports of all vehicles, and the fleet file that follows from them.

Each process judges the same reports, so all come to the same fleet file.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from math import ceil
from typing import Final

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
"""Loss up to which flights were measured to converge in time (docs/certified.md)."""
_CLOCK_ROOM: Final = 1.25
"""Factor between the measured bound of a clock and the one that the fleet file allows."""
_SIGMA_STEP, _CLOCK_STEP_US = 0.01, 1_000


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
    checks.append(
        Check(
            "fleet", "tube", Result.NOTE, f"{found.certified.tube} m of the file, not measured on the ground"
        )
    )
    text = f"plans keep {distance_of(found):.2f} m for a d_min of {found.field.d_min:g} m"
    checks.append(Check("fleet", "distance", Result.PASS, text))
    return Verdict(tuple(checks), settings_of(found, origin, _measurement(reports, seconds)))


def _of_report(system: int, report: Report) -> Check:
    sigma = "unknown" if report.sigma is None else f"{1e-3 * report.sigma:.2f} m"
    clock = "unknown" if report.clock is None else f"{1e-3 * report.clock:.1f} ms"
    text = f"σ {sigma}, clock {clock}"
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
    sigmas = [report.sigma for report in reports.values() if report.sigma is not None]
    if sigmas and not any(report.sigma_fixed for report in reports.values()):
        steps = ceil(max(sigmas) / (1e3 * _SIGMA_STEP))
        field = field.model_copy(update={"position_sigma": round(steps * _SIGMA_STEP, 6)})
    clocks = [report.clock for report in reports.values() if report.clock is not None]
    if clocks and not any(report.clock_fixed for report in reports.values()):
        allowed = ceil(_CLOCK_ROOM * max(clocks) / _CLOCK_STEP_US) * _CLOCK_STEP_US
        certified = certified.model_copy(update={"clock_us": min(max(allowed, _CLOCK_STEP_US), WORST)})
    return config.model_copy(update={"field": field, "certified": certified})


def _measurement(reports: Mapping[int, Report], seconds: float) -> Measurement:
    last = max(report.utc for report in reports.values())
    configured = ["tube"]
    if any(report.sigma is None for report in reports.values()):
        configured.append("position_sigma")
    return Measurement(
        at=datetime.fromtimestamp(last, UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
        seconds=seconds,
        configured=tuple(configured),
        vehicles=tuple(
            VehicleFigures(
                system=system,
                firmware=KNOWN[report.autopilot].name if report.autopilot in KNOWN else "unknown",
                position_sigma=None if report.sigma is None else round(1e-3 * report.sigma, 3),
                clock_us=report.clock,
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
