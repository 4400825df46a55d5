"""Tracking errors of a certified trial: distances from the plans, by reported and by true positions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.config import CompanionConfig
from mavlink_bridge.frames import FleetFrame
from outrider.errors import InputError
from outrider.preflight.tube import tracking_error
from trials.flown import Flown, flown_by_clock
from trials.measures import tracking_errors
from trials.separation import Track

Array = NDArray[np.float64]


LEAD_US: Final = CompanionConfig(avoidance="certified").setpoint_lead_us
"""Time (µs) by which the companions of a trial send set-points ahead."""


class CertifiedTracking(NamedTuple):
    """Largest distances of one vehicle in a trial (m); None: unknown.

    ``reported``: from the plan to the reported position, as ``outrider preflight --flight`` measures it.
    ``estimate``: from the reported to the true position. ``true``: from the plan to the true position.
    """

    reported: float | None
    estimate: float | None
    true: float | None

    @property
    def document(self) -> dict[str, float | None]:
        """Distances as JSON values."""
        return {name: None if value is None else round(value, 3) for name, value in self._asdict().items()}


def certified_tracking(
    logs: Sequence[Path],
    system: int,
    fleet: FleetFrame,
    truth: Track | None,
    seconds: Callable[[Array], Array],
    steered: tuple[float, float],
) -> CertifiedTracking:
    """Return the largest distances of ``system`` in the ``logs`` of its companion.

    ``truth``: true positions by the trial's time, None if they are those that the vehicle reports;
    ``seconds`` converts times of the companion's clock (s) to it. True positions count while the companion
    ``steered``, from and until these times (s).
    """
    errors = []
    for log in logs:
        # A log of less than ten seconds of flight is refused.
        with suppress(InputError):
            errors.append(tracking_error(log, system, planar=False, lead=LEAD_US).largest)
    flights = [flown_by_clock(log, system, fleet, seconds) for log in logs]
    known = [flight for flight in flights if flight is not None]
    reported = max(errors, default=None)
    if truth is None:
        return CertifiedTracking(reported, None, None)
    return CertifiedTracking(
        reported,
        _largest([truth.beside(_steered(flight, steered)) for flight in known]),
        _largest([tracking_errors(flight.setpoints.between(*steered), truth) for flight in known]),
    )


def logs_of(directory: Path, system: int) -> list[Path]:
    """Return the logs of the companion of ``system`` below ``directory``, without those of backup nodes."""
    found = sorted(directory.rglob(f"vehicle-{system}.tlog"))
    return [log for log in found if not log.parent.name.startswith("backup")]


def _steered(flight: Flown, steered: tuple[float, float]) -> Track:
    times, places, armed = flight.reported
    chosen = (times >= steered[0]) & (times <= steered[1])
    return Track(times[chosen], places[chosen], armed[chosen])


def _largest(parts: Sequence[Array]) -> float | None:
    known = np.concatenate(parts) if parts else np.empty(0)
    known = known[~np.isnan(known)]
    return float(known.max()) if len(known) else None
