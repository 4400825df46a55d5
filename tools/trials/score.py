"""Figures of a sortie from its tracks and logs, and the limits that it has to meet."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from trials.flown import Flown
from trials.measures import (
    Spread,
    converged_after,
    joined,
    largest_step,
    looks,
    spread,
    surface_errors,
    tracking_errors,
)
from trials.separation import Track
from trials.sortie import ESCORT, GO, RETURN, RUN, WALK
from trials.stage import Stage

Array = NDArray[np.float64]
CLOSEST: Final = 1.5
"""Least distance between two vehicles (m): a trial has neither wind nor message loss."""
TRACKING: Final = 0.35
"""Limit of the distance from set-point to the vehicle's reported position, 95 % (m)."""
STEP: Final = 0.3
"""Limit of a set-point's distance from where the one before leads (m)."""
CONVERGED: Final = 15.0
"""Limit of the time from the go until all vehicles are at their places (s)."""
STANDOFF: Final = 0.6
"""Limit of the reported distance from the surface while the target walks, 95 % (m)."""


class Score(NamedTuple):
    """Figures of a sortie; None: unknown.

    Distances are in m. ``tracking``: from set-points to reported positions; ``true_tracking``: to true
    positions; ``estimate``: between the two. ``step``: the largest step of a set-point. ``standoff``,
    ``true_standoff``: from the surface, by the target's pace, reported and true. ``converged``,
    ``truly_converged``: s after the go. ``anchored``: number of times that plans restarted at the vehicle's
    position.
    """

    tracking: Spread | None
    true_tracking: Spread | None
    estimate: Spread | None
    step: float
    standoff: Mapping[str, Spread | None]
    true_standoff: Mapping[str, Spread | None]
    converged: float | None
    truly_converged: float | None
    anchored: int | None

    @property
    def document(self) -> dict[str, Any]:
        """Figures as JSON values, for the verdict."""
        return {
            "tracking_error_m": _rounded(self.tracking),
            "true_tracking_error_m": _rounded(self.true_tracking),
            "estimate_error_m": _rounded(self.estimate),
            "setpoint_step_m": round(self.step, 3),
            "standoff_error_m": {name: _rounded(value) for name, value in self.standoff.items()},
            "true_standoff_error_m": {name: _rounded(value) for name, value in self.true_standoff.items()},
            "converged_s": None if self.converged is None else round(self.converged, 1),
            "truly_converged_s": None if self.truly_converged is None else round(self.truly_converged, 1),
            "anchored_anew": self.anchored,
        }

    def faults(self, closest: float | None) -> list[str]:
        """Return the limits that are not met; ``closest``: least distance of two vehicles (m)."""
        wrong = []
        if closest is None or closest < CLOSEST:
            wrong.append(f"two vehicles were {_said(closest)} m apart; a sortie allows {CLOSEST} m")
        if self.tracking is None or self.tracking.p95 > TRACKING:
            p95 = None if self.tracking is None else self.tracking.p95
            wrong.append(f"vehicles were {_said(p95)} m off their set-points (95 %); allowed: {TRACKING} m")
        if self.step > STEP:
            wrong.append(f"a set-point was {self.step:.2f} m beside where the last led; allowed: {STEP} m")
        if self.anchored is None or self.anchored:
            wrong.append(f"{_count(self.anchored)} plans began anew where the vehicle was; allowed: none")
        if self.converged is None or self.converged > CONVERGED:
            wrong.append(f"all were there {_said(self.converged)} s after the go; allowed: {CONVERGED} s")
        walking = self.standoff.get(WALK)
        if walking is None or walking.p95 > STANDOFF:
            p95 = None if walking is None else walking.p95
            wrong.append(f"stand-off from a walking target {_said(p95)} m (95 %); allowed: {STANDOFF} m")
        return wrong


def score(
    logs: Mapping[int, Sequence[Flown]],
    tracks: Mapping[int, Track],
    stage: Stage,
    nearest: Callable[[Array], Array],
    anchored: int | None,
) -> Score:
    """Return the figures of a sortie, as far as its marks go.

    ``tracks``: true positions; ``nearest``: maps an offset from the target to the nearest point of the
    surface; ``anchored``: count of restarted plans, None if unknown.
    """
    marks = stage.marks
    own = {system: _joined(parts) for system, parts in logs.items() if parts}
    steered = {
        system: [part.setpoints.between(*stage.steered(system)) for part in parts]
        for system, parts in logs.items()
    }
    acts = [(name, marks[name], marks[end]) for name, end in ((WALK, RUN), (RUN, RETURN)) if end in marks]

    def beside(flown: Mapping[int, Track]) -> dict[str, Spread | None]:
        if len(flown) < len(tracks):
            return {}
        return {
            name: spread(surface_errors(flown, stage.target, nearest, looks(begin, end)))
            for name, begin, end in acts
        }

    def converged(flown: Mapping[int, Track]) -> float | None:
        if ESCORT not in marks or len(flown) < len(tracks):
            return None
        times = looks(marks[GO], marks.get(RETURN, stage.ended))
        return converged_after(surface_errors(flown, stage.target, nearest, times), times)

    return Score(
        spread(joined([tracking_errors(one, own[k]) for k, parts in steered.items() for one in parts])),
        spread(joined([tracking_errors(one, tracks[k]) for k, parts in steered.items() for one in parts])),
        spread(joined([tracks[k].beside(track) for k, track in own.items()])),
        max((largest_step(one) for parts in steered.values() for one in parts), default=0.0),
        beside(own),
        beside(tracks),
        converged(own),
        converged(tracks),
        anchored,
    )


def _joined(parts: Sequence[Flown]) -> Track:
    tracks = [part.reported for part in parts]
    return Track(*(np.concatenate(column) for column in zip(*tracks, strict=True)))


def _rounded(value: Spread | None) -> dict[str, float] | None:
    return None if value is None else {name: round(part, 3) for name, part in value._asdict().items()}


def _said(value: float | None) -> str:
    return "no known number of" if value is None else f"{value:.2f}"


def _count(value: int | None) -> str:
    return "nobody knows how many" if value is None else str(value)
