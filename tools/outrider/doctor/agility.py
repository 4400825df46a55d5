"""Limits that the autopilot can follow, from its parameters.

They are compared with the stock firmware and with the shipped companion files.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache
from typing import Final, NamedTuple

from pymavlink.dialects.v20 import all as mavlink

from companion.flight.autopilots.limits import STOCK, Limits, limits_of, stock_parameters
from outrider.doctor.case import Case
from outrider.doctor.finding import Finding, Severity
from outrider.logs.flight_modes import ROTORCRAFT
from outrider.resources import find
from outrider.scenarios.fly_config import FlyConfig
from outrider.yaml_files.yaml_file import load

_COMPANION_FILES: Final = {mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA: "ardupilot", mavlink.MAV_AUTOPILOT_PX4: "px4"}
_STOPPING_SPEED: Final = 5.0
"""Speed for which the stopping distance is given (m/s).

It was v_max of the shipped companions at their first flights.
"""
_LOWER_RATIO: Final = 0.99
"""Ratio to the stock value below which a limit counts as lower: float32 is not exact."""


class Demand(NamedTuple):
    """Horizontal demand of a companion on its autopilot.

    ``acceleration`` (m/s²) and ``speed`` (m/s) are on one axis; ``total`` is the acceleration (m/s²)
    including that of the field.
    """

    acceleration: float
    speed: float
    total: float


@lru_cache
def shipped(autopilot: int) -> Demand:
    """Return the demand of the companion file that is shipped for a MAV_AUTOPILOT."""
    limits = load(find("companions", _COMPANION_FILES[autopilot]), FlyConfig).companion.limits
    return Demand(max(limits.strongest[:2]), max(limits.fastest[:2]), limits.a_total)


def agility(case: Case) -> Iterator[Finding]:
    """Yield the limits that the autopilot can follow, and each parameter that lowers one below stock."""
    beat = case.vehicle.vehicle.heartbeat
    if case.profile is None or beat is None or beat.type not in ROTORCRAFT:
        return
    reported = {
        name: value for name in stock_parameters(case.autopilot) if (value := _number(case, name)) is not None
    }
    if not reported:
        names = ", ".join(stock_parameters(case.autopilot))
        yield Finding(
            f"what it can follow is not {'in the log' if case.log else 'told'}",
            Severity.NOTE,
            f"Separation depends on it: {names}. Stock values are assumed.",
            "Have the ground station load all parameters while it records."
            if case.log
            else "Read them in a ground station.",
        )
        return
    yield summary(
        limits_of(case.autopilot, reported), shipped(case.autopilot), _COMPANION_FILES[case.autopilot]
    )
    for name, value in reported.items():
        yield from lowered(case.autopilot, name, value)


def summary(limits: Limits, demand: Demand, file: str) -> Finding:
    """Return all limits as one finding, compared with the demand of the companion ``file``."""
    what = (
        f"it follows up to {limits.acceleration:.3g} m/s², {limits.jerk:.3g} m/s³, {limits.speed:.3g} m/s "
        f"and {math.degrees(limits.tilt):.0f}° of tilt"
    )
    stop = f"From {_STOPPING_SPEED:g} m/s it stops in {limits.stopping_distance(_STOPPING_SPEED):.1f} m."
    how = (
        "Set-points beyond these limits are followed late."
        if limits.shaped
        else "In OFFBOARD only speed and tilt are enforced; the rest applies to its own modes."
    )
    more = []
    if limits.usable_acceleration < _LOWER_RATIO * demand.acceleration:
        more.append(f"{demand.acceleration:g} m/s² an axis, {demand.total:g} with its field")
    if limits.speed < _LOWER_RATIO * demand.speed:
        more.append(f"{demand.speed:g} m/s")
    if not more:
        return Finding(what, Severity.OK, f"{how} {stop}")
    return Finding(
        what,
        Severity.WARNING,
        f"The shipped file {file} asks for {' and '.join(more)}. {how} {stop} The vehicle then departs "
        "from its plan, and may come too near to others.",
        "Raise the autopilot's limits where the vehicle allows it, or lower u_max, v_max and a_total in the "
        "companion's file.",
    )


def lowered(autopilot: int, name: str, value: float) -> Iterator[Finding]:
    """Yield a warning if the parameter ``name`` alone makes a limit lower than the stock firmware's."""
    stock, limits = STOCK[autopilot], limits_of(autopilot, {name: value})
    costs = list(_costs(limits, stock))
    if not costs:
        return
    usual = stock_parameters(autopilot)[name]
    if not limits.shaped and name in ("MPC_ACC_HOR", "MPC_JERK_MAX"):
        costs.append("PX4 enforces it in its own modes, such as HOLD when set-points stop, not in OFFBOARD.")
    yield Finding(
        f"{name} = {value:g}, stock is {usual:g}",
        Severity.WARNING,
        " ".join(costs),
        f"Set {name} to {usual:g}; if the vehicle needs the lower value, lower the companion's limits too.",
    )


def _costs(limits: Limits, stock: Limits) -> Iterator[str]:
    ways = limits.stopping_distance(_STOPPING_SPEED), stock.stopping_distance(_STOPPING_SPEED)
    if (
        limits.usable_acceleration < _LOWER_RATIO * stock.usable_acceleration
        or limits.jerk < _LOWER_RATIO * stock.jerk
    ):
        yield (
            f"It allows {limits.usable_acceleration:.3g} m/s² and {limits.jerk:.3g} m/s³: from "
            f"{_STOPPING_SPEED:g} m/s it stops in {ways[0]:.1f} m, stock in {ways[1]:.1f} m."
        )
    elif limits.tilt < _LOWER_RATIO * stock.tilt:
        yield (
            f"{math.degrees(limits.tilt):.0f}° of tilt give {limits.tilt_acceleration:.1f} m/s² for wind and "
            f"motion together, stock {stock.tilt_acceleration:.1f} m/s²."
        )
    if limits.speed < _LOWER_RATIO * stock.speed:
        yield f"It corrects its way with {limits.speed:.3g} m/s at most, stock {stock.speed:.3g} m/s."
    vertical, usual = min(limits.climb, limits.sink), min(stock.climb, stock.sink)
    if vertical < _LOWER_RATIO * usual:
        yield f"It climbs or sinks with {vertical:.3g} m/s at most, stock {usual:.3g} m/s."
    if limits.position_gain < _LOWER_RATIO * stock.position_gain:
        yield _slower("A distance from the set-point", limits.position_gain, stock.position_gain)
    if limits.velocity_gain < _LOWER_RATIO * stock.velocity_gain:
        yield _slower("A difference in velocity", limits.velocity_gain, stock.velocity_gain)


def _slower(what: str, gain: float, usual: float) -> str:
    if gain <= 0.0:
        return f"{what} is not corrected."
    return f"{what} halves in {math.log(2.0) / gain:.1f} s, stock in {math.log(2.0) / usual:.1f} s."


def _number(case: Case, name: str) -> float | None:
    value = case.parameter(name)
    return value if value is not None and math.isfinite(value) else None
