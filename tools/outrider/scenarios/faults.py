"""Faults of a scenario and their times: ``at_s`` counts from the goal event."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from outrider.scenarios.part import Duration, Part, Position, Seconds, Share, System


class _OfVehicle(Part):
    vehicle: System = Field(description="system id")


class _Fault(_OfVehicle):
    at_s: Seconds


class Freeze(_Fault):
    """Freeze of the companion: it computes nothing for a while; input waits as in a socket's buffer."""

    kind: Literal["freeze"]
    for_s: Duration


class Vanish(_Fault):
    """End of the companion for good: no set-points, no messages; the autopilot's time-outs apply."""

    kind: Literal["vanish"]


class GpsLoss(_Fault):
    """Loss of the autopilot's position fix for a while."""

    kind: Literal["gps_loss"]
    for_s: Duration


class GpsJump(_Fault):
    """Offset of the autopilot's position fix by ``offset`` (m, ENU) for a while."""

    kind: Literal["gps_jump"]
    for_s: Duration
    offset: Position


class MotorFailure(_Fault):
    """Failure of a rotor, which delivers only ``left`` of its thrust from then on."""

    kind: Literal["motor"]
    rotor: int = Field(ge=0, le=15, description="index in the vehicle's file")
    left: Share = 0.0


class ClockFault(_OfVehicle):
    """Clock error of the companion: ``late_ms`` late (negative: early) from the start, ``drift_ppm`` fast.

    The clock does not step in flight: a companion reads the time once and then uses its monotonic clock.
    """

    kind: Literal["clock"]
    late_ms: float = Field(0.0, ge=-60_000.0, le=60_000.0)
    drift_ppm: float = Field(0.0, ge=-10_000.0, le=10_000.0)


Sudden = Freeze | Vanish | GpsLoss | GpsJump | MotorFailure
"""Faults that occur at a certain time."""
FaultPart = Annotated[Sudden | ClockFault, Field(discriminator="kind")]


class Clocks(Part):
    """Errors of the companions' clocks from the start: drawn per seed, uniform in ± these bounds."""

    offset_ms: float = Field(1.0, ge=0.0, le=1_000.0)
    drift_ppm: float = Field(20.0, ge=0.0, le=1_000.0)
