"""Rows of the paper's comparison: scenario, method, and the time that the paper reports."""

from __future__ import annotations

from typing import Literal, NamedTuple

from outrider.sweep.cells import Cell, cells
from outrider.sweep.grid import Sweep

Response = Literal["exact", "firmware"]
SENSORS = "rtk"
"""Sensor profile: times are compared for vehicles whose position is known to 2 cm."""


class Row(NamedTuple):
    """One row. ``reported``: the paper's result (Sec. IV-B to IV-G): time (s), "stuck", or empty."""

    scenario: str
    method: str
    reported: str


ROWS = (
    Row("scenario-1", "baseline", "40"),
    Row("scenario-1", "swivel", "12"),
    Row("scenario-1", "approach_angle", "≈ 15"),
    Row("scenario-1", "tangential", "≈ 15"),
    Row("scenario-2", "baseline", "30"),
    Row("scenario-2", "swivel", "15"),
    Row("scenario-2", "approach_angle", "≈ 15"),
    Row("scenario-2", "tangential", "≈ 15"),
    Row("scenario-3", "baseline", "stuck"),
    Row("scenario-3", "swivel", "stuck"),
    Row("scenario-3", "approach_angle", "stuck"),
    Row("scenario-3", "tangential", "12"),
    Row("antipodal-8", "approach_angle", "13"),
    Row("antipodal-8", "tangential", "11"),
    Row("antipodal-16", "tangential", ""),
)


def cells_of(rows: tuple[Row, ...], response: Response = "exact") -> list[Cell]:
    """Return the cell of each row: the shipped scenario with its method, on autopilots of that ``response``.

    The flight starts in the air, because the paper counts its times from vehicles in the air.
    """
    found = []
    followed = {} if response == "exact" else {"autopilot.response": response}
    for number, row in enumerate(rows, 1):
        spec = Sweep(
            name="paper",
            scenarios=(row.scenario,),
            set={"airborne": True, "sensors": SENSORS, "companion.methods": [row.method], **followed},
        )
        (cell,) = cells(spec, f"{row.scenario} by {row.method}")
        slug = f"{number:03d}-{row.scenario}-{row.method}"
        found.append(cell._replace(label=f"{row.scenario}, {row.method}", slug=slug))
    return found
