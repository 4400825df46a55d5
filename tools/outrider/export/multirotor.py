"""Multirotor made of Foxglove's shapes, and the shared plans of vehicles as scene entities."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import atan2, cos, hypot, sin

import numpy as np

from outrider.export import foxglove, foxglove_schemas
from outrider.export.foxglove import Color, Json
from outrider.export.mcap_file import Entry, entry
from outrider.palette import ACCENT, BODY
from outrider.scene.airframe import Airframe
from outrider.scene.planes import between, facing
from outrider.scene.recorded import Record

PLANS_EVERY_US = 200_000
"""Period (µs) at which plans and planes are drawn."""
_BODY, _PLANE = Color.of(BODY), Color.of(ACCENT).faint(0.25)
_DISC_OPACITY = 0.6
_PLANE_DIAMETER, _PLANE_THICKNESS = 1.5, 0.01
"""Size (m) of the disc that stands for a plane."""


def shapes(frame: Airframe, color: Color) -> dict[str, list[Json]]:
    """Return the shapes of a vehicle in its frame, x forward, z up: hub, arms, motors, rotors, nose."""
    span = frame.span
    hub = foxglove.cylinder((0.0, 0.0, 0.0), 0.22 * span, 0.1 * span, _BODY)
    nose = foxglove.arrow(0.34 * span, 0.06 * span, color)
    arms, rotors = [], []
    for x, y in frame.hubs:
        reach, half = span * hypot(x, y), 0.5 * atan2(y, x)
        middle = (0.5 * span * x, 0.5 * span * y, 0.0)
        arms.append(
            foxglove.cube(middle, (reach, 0.04 * span, 0.04 * span), _BODY, (cos(half), 0.0, 0.0, sin(half)))
        )
        motor = (span * x, span * y, 0.015 * span)
        disc = (span * x, span * y, 0.06 * span)
        rotors.append(foxglove.cylinder(motor, 0.09 * span, 0.07 * span, _BODY))
        rotors.append(
            foxglove.cylinder(disc, 2.0 * frame.disc * span, 0.012 * span, color.faint(_DISC_OPACITY))
        )
    return {"cylinders": [hub, *rotors], "cubes": arms, "arrows": [nose]}


def plans(
    times: Sequence[int], records: Sequence[tuple[int, Record]], paint: dict[int, Color], step_s: float | None
) -> Iterator[Entry]:
    """Yield the plans that the vehicles share, and the planes between them, five times a second.

    ``times``: Unix µs, rising; ``records`` by system id. ``step_s`` is the step of plans with separating
    planes; None for a fleet without them. A vehicle without a recent plan has an empty line, which removes
    the last one.
    """
    due = -1
    for time in times:
        if time < due:
            continue
        due = time + PLANS_EVERY_US
        knots = np.array([record.plan(time) for _, record in records])
        there = np.isfinite(knots).all(axis=(1, 2))
        drawn = [
            foxglove.entity(
                time,
                "fleet",
                f"plan-{system}",
                {"lines": [foxglove.line(knots[k, :, :3].tolist(), 3.0, paint[system])] if there[k] else []},
            )
            for k, (system, _) in enumerate(records)
        ]
        yield entry(time, "/scene/plans", foxglove_schemas.SCENE_UPDATE, foxglove.update(*drawn))
        if step_s is None:
            continue
        found = between(knots[there], step_s)
        discs = [
            foxglove.cylinder(at, _PLANE_DIAMETER, _PLANE_THICKNESS, _PLANE, quaternion)
            for at, quaternion in zip(found.middle.tolist(), facing(found.normal).tolist(), strict=True)
        ]
        planes = foxglove.entity(time, "fleet", "planes", {"cylinders": discs})
        yield entry(time, "/scene/planes", foxglove_schemas.SCENE_UPDATE, foxglove.update(planes))
