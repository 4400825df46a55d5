"""Configured limits, lowered to what the autopilot can follow with its parameters.

A set-point beyond the firmware's limits is followed late: the vehicle is then not where its plan says, and
the separation of the plans is of no use. The jerk is lowered only where the firmware bounds it on set-points
(``Limits.shaped``); elsewhere ``j_max`` stays as configured. The bounds on the horizontal norms of jerk and
speed are divided between the two axes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import degrees, hypot, inf
from typing import NamedTuple

from companion.config.planning import NEAREST_FLOOR, LimitsConfig
from companion.flight.autopilots import Loop, Profile, Shaping
from companion.flight.autopilots.limits import STOCK, Limits, deciding, limits_of

_AXIS_SHARE = 0.7
"""Share of the bound on a horizontal norm that each of the two axes may use, about 1/√2."""
_TILT_SHARE = 0.9
"""Share of the acceleration at the largest tilt that plan and compensation may use; the rest is for gusts."""
_TOLERANCE = 1e-3
"""Relative difference up to which a lower limit counts as equal: parameters are float32."""

_MIN_JERK, _MIN_ACCELERATION, _MIN_TILT_DEG = 1.0, 1.0, 10.0
"""The least values with which an escort is flown: m/s³, m/s² and degrees.

With 1 m/s³, if no other limit is reached, a vehicle needs 1.8 m to stop from a walker's 1.5 m/s, and 6.5 m
from 3.5 m/s.
"""
_MIN_SPEED, _MIN_VERTICAL_SPEED, _MIN_POSITION_GAIN, _MIN_VELOCITY_GAIN = 1.0, 0.3, 0.3, 0.5
"""The least values with which an escort is flown: m/s, m/s up and down, 1/s and 1/s.

With lower gains a position error lasts for more than three seconds, and a velocity error for more than two.
"""


class Lowered(NamedTuple):
    """Result of ``lowered``.

    ``limits``: limits for plans. ``acceleration`` (m/s²): bound on the sum of plan and compensation,
    horizontal. ``loop``: the autopilot's gains, None where the stock firmware's are to be used. ``changes``:
    descriptions of what was lowered; ``lacking``: description of what is too low for any escort, empty if
    nothing is.
    """

    limits: LimitsConfig
    acceleration: float = inf
    loop: Loop | None = None
    changes: tuple[str, ...] = ()
    lacking: str = ""


def lowered(limits: LimitsConfig, profile: Profile, parameters: Mapping[str, float]) -> Lowered:
    """Return ``limits``, lowered to what an autopilot with these ``parameters`` can follow.

    They are returned unchanged if the autopilot cannot fly an escort at all.
    """
    able = limits_of(profile.autopilot, parameters)
    lacking = "; ".join(_lacking(able, profile.autopilot, parameters))
    if lacking:
        return Lowered(limits, lacking=lacking)
    room = _TILT_SHARE * able.tilt_acceleration
    a_total = min(limits.a_total, room)
    u = min(able.acceleration, a_total)
    speed = min(1.0, able.speed / hypot(*limits.fastest[:2]))
    up = able.climb if limits.v_min is not None else min(able.climb, able.sink)
    x, y, z = limits.v_max
    found = limits.model_copy(
        update={
            "u_max": (min(limits.u_max[0], u), min(limits.u_max[1], u), min(limits.u_max[2], a_total)),
            "v_max": (speed * x, speed * y, min(z, up)),
            "a_total": a_total,
            "j_max": _jerk(limits, able),
        }
    )
    if limits.u_min is not None:
        x, y, z = limits.u_min
        found = found.model_copy(update={"u_min": (max(x, -u), max(y, -u), max(z, -a_total))})
    if limits.v_min is not None:
        x, y, z = limits.v_min
        lower = [min(speed * one, NEAREST_FLOOR) for one in (x, y)]
        found = found.model_copy(update={"v_min": (*lower, max(z, -able.sink))})
    reported = tuple(
        f"{what} ({' '.join((name, f'{value:g}'))})"
        for what, limit in _changes(limits, found, able)
        for name, value in (deciding(profile.autopilot, parameters, limit),)
    )
    # If the limits are lower only by rounding they stay as configured.
    return Lowered(found if reported else limits, room, _loop(profile, able), reported)


def _jerk(limits: LimitsConfig, able: Limits) -> tuple[float, float, float] | None:
    if not able.shaped:
        return limits.j_max
    x, y, z = limits.j_max or (inf, inf, _AXIS_SHARE * able.jerk)
    return min(x, _AXIS_SHARE * able.jerk), min(y, _AXIS_SHARE * able.jerk), z


def _loop(profile: Profile, able: Limits) -> Loop:
    """Return the loop gains for the limits ``able``, from which those of ArduPilot's trajectory follow."""
    loop = profile.loop._replace(position=able.position_gain, velocity=able.velocity_gain)
    if not able.shaped:
        return loop
    rate = able.jerk / able.acceleration
    slew = loop.slew * min(1.0, able.jerk / STOCK[profile.autopilot].jerk)
    return loop._replace(slew=slew, shaping=Shaping(able.jerk, 0.5 * rate, rate))


def _changes(before: LimitsConfig, after: LimitsConfig, able: Limits) -> Iterator[tuple[str, str]]:
    """Yield a text for each limit that is lower in ``after``, and the responsible field of ``able``."""
    push = "acceleration" if able.acceleration < after.a_total else "tilt"
    climb = "climb" if able.climb < able.sink or before.v_min is not None else "sink"
    jerks = before.j_max or (inf, inf, inf), after.j_max or (inf, inf, inf)
    for name, unit, was, is_now, limit in (
        ("j_max", "m/s³", max(jerks[0][:2]), max(jerks[1][:2]), "jerk"),
        ("a_total", "m/s²", before.a_total, after.a_total, "tilt"),
        ("u_max", "m/s²", max(before.u_max[:2]), max(after.u_max[:2]), push),
        ("u_max up", "m/s²", before.u_max[2], after.u_max[2], "tilt"),
        ("v_max", "m/s", max(before.v_max[:2]), max(after.v_max[:2]), "speed"),
        ("v_max up", "m/s", before.v_max[2], after.v_max[2], climb),
        *_changes_of_least(before, after, push),
    ):
        if abs(is_now) < (1.0 - _TOLERANCE) * abs(was):
            yield f"{name} {is_now:.3g} {unit}", limit


def _changes_of_least(
    before: LimitsConfig, after: LimitsConfig, push: str
) -> Iterator[tuple[str, str, float, float, str]]:
    """Yield of each least value: name, unit, what it was and is now, and the responsible field."""
    if before.u_min is not None and after.u_min is not None:
        yield "u_min", "m/s²", min(before.u_min[:2]), min(after.u_min[:2]), push
        yield "u_min vertical", "m/s²", before.u_min[2], after.u_min[2], "tilt"
    if before.v_min is not None and after.v_min is not None:
        yield "v_min", "m/s", min(before.v_min[:2]), min(after.v_min[:2]), "speed"
        yield "v_min vertical", "m/s", before.v_min[2], after.v_min[2], "sink"


def _lacking(able: Limits, autopilot: int, parameters: Mapping[str, float]) -> Iterator[str]:
    for what, unit, limit, is_now, least in (
        ("jerk", "m/s³", "jerk", able.jerk if able.shaped else inf, _MIN_JERK),
        ("horizontal acceleration", "m/s²", "acceleration", able.acceleration, _MIN_ACCELERATION),
        ("tilt", "°", "tilt", degrees(able.tilt), _MIN_TILT_DEG),
        ("speed", "m/s", "speed", able.speed, _MIN_SPEED),
        ("rate of climb", "m/s", "climb", able.climb, _MIN_VERTICAL_SPEED),
        ("rate of descent", "m/s", "sink", able.sink, _MIN_VERTICAL_SPEED),
        ("position gain", "1/s", "position_gain", able.position_gain, _MIN_POSITION_GAIN),
        ("velocity gain", "1/s", "velocity_gain", able.velocity_gain, _MIN_VELOCITY_GAIN),
    ):
        if is_now < (1.0 - _TOLERANCE) * least:
            name, value = deciding(autopilot, parameters, limit)
            yield f"a {what} of {least:g} {unit} at least: {name} {value:g} gives {is_now:.2g}"
