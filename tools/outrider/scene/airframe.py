"""Shape of a multirotor for pictures: hubs and senses of its rotors, in shares of its span."""

from __future__ import annotations

from math import cos, pi, sin
from typing import NamedTuple

from outrider.errors import InputError
from outrider.resources import find
from outrider.yaml_files.yaml_file import load
from sitl.vehicle.config import VehicleConfig


class Airframe(NamedTuple):
    """Multirotor of ``span`` (m) from tip to tip.

    ``hubs``: places of the n rotors forward and left of the centre, and ``disc``: radius of a rotor, both as
    shares of the span. ``spins``: +1 for a rotor that turns counter-clockwise seen from above, −1 for
    clockwise. ``point``: whether the vehicle moves exactly as its set-points say, without physics.
    """

    span: float
    hubs: tuple[tuple[float, float], ...]
    spins: tuple[float, ...]
    disc: float
    point: bool = False


_TURNS = tuple(pi * (k + 0.5) / 3.0 for k in range(6))
HEXAROTOR = Airframe(0.63, tuple((0.341 * cos(a), 0.341 * sin(a)) for a in _TURNS), (1.0, -1.0) * 3, 0.159)
"""Shape where none is known: that of the firefly."""


def airframe_of(vehicle: VehicleConfig) -> Airframe:
    """Return the shape of ``vehicle``; a propeller reaches from its hub to the span's circle."""
    reach = max(rotor.arm for rotor in vehicle.rotors)
    return Airframe(
        float(vehicle.span),
        tuple((x / vehicle.span, -y / vehicle.span) for x, y, _ in (one.position for one in vehicle.rotors)),
        tuple(one.spin_sign for one in vehicle.rotors),
        max(0.5 - reach / vehicle.span, 0.05),
        vehicle.motion == "point",
    )


def airframe(vehicle: str) -> Airframe:
    """Return the shape of the vehicle of a scenario, or ``HEXAROTOR`` if its file is not available."""
    try:
        return airframe_of(load(find("vehicles", vehicle), VehicleConfig))
    except InputError:
        return HEXAROTOR
