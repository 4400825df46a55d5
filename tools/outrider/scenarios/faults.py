"""Faults of a scenario and their times: ``at_s`` counts from the goal event."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from outrider.scenarios.part import Duration, Part, Position, Seconds, Share, System


class _OfVehicle(Part):
    vehicle: System = Field(description="system id")


class _Fault(_OfVehicle):
    at_s: Seconds = Field(description="s after the goal event")


class Freeze(_Fault):
    """Freeze of the companion: it computes nothing for a while; input waits as in a socket's buffer."""

    kind: Literal["freeze"]
    for_s: Duration = Field(description="s that it lasts")


class Vanish(_Fault):
    """End of the companion for good: no set-points, no messages; the autopilot's time-outs apply."""

    kind: Literal["vanish"]


class Restart(_Fault):
    """End of the companion, and ``for_s`` later another one with the same id.

    It knows nothing of the flight; the operator gives it the go and the goal again.
    """

    kind: Literal["restart"]
    for_s: Duration = Field(description="s until the other one begins")


class GpsLoss(_Fault):
    """Loss of the autopilot's position fix for a while."""

    kind: Literal["gps_loss"]
    for_s: Duration = Field(description="s that it lasts")


class GpsJump(_Fault):
    """Offset of the autopilot's position fix by ``offset`` (m, ENU) for a while."""

    kind: Literal["gps_jump"]
    for_s: Duration = Field(description="s that it lasts")
    offset: Position = Field(description="m, ENU")


class MotorFailure(_Fault):
    """Failure of a rotor, which delivers only ``left`` of its thrust from then on."""

    kind: Literal["motor"]
    rotor: int = Field(ge=0, le=15, description="index in the vehicle's file")
    left: Share = Field(0.0, description="share of the thrust that is left")


class ClockFault(_OfVehicle):
    """Clock error of the companion: ``late_ms`` late (negative: early) from the start, ``drift_ppm`` fast.

    This clock does not step in flight: a companion reads the time once and then uses its monotonic clock.
    The system clock, a source of fleet time, does (``clock_step``).
    """

    kind: Literal["clock"]
    late_ms: float = Field(
        0.0, ge=-600_000.0, le=600_000.0, description="ms by which it is late; negative: early"
    )
    drift_ppm: float = Field(
        0.0, ge=-10_000.0, le=10_000.0, description="parts per million by which it is fast"
    )


class AutopilotClockFault(_OfVehicle):
    """Clock error of the autopilot from the start.

    Its UTC is ``utc_error_ms`` ahead when it is set, and its clock ``drift_ppm`` fast.
    """

    kind: Literal["autopilot_clock"]
    utc_error_ms: float = Field(
        0.0, ge=-600_000.0, le=600_000.0, description="ms by which its UTC is ahead when it is set"
    )
    drift_ppm: float = Field(
        0.0, ge=-10_000.0, le=10_000.0, description="parts per million by which it is fast"
    )
    utc: bool = Field(True, description="false: it never learns UTC, as without GNSS time")


class UtcStep(_Fault):
    """Step of the autopilot's UTC by ``step_ms``: from then on SYSTEM_TIME is that much ahead."""

    kind: Literal["utc_step"]
    step_ms: float = Field(ge=-600_000.0, le=600_000.0, description="ms; positive: ahead")


class ClockStep(_Fault):
    """Step of the companion's system clock by ``step_ms``, while its kernel reports an unchanged error."""

    kind: Literal["clock_step"]
    step_ms: float = Field(ge=-600_000.0, le=600_000.0, description="ms; positive: ahead")


Sudden = Freeze | Vanish | Restart | GpsLoss | GpsJump | MotorFailure | UtcStep | ClockStep
"""Faults that occur at a certain time."""
FromStart = ClockFault | AutopilotClockFault
"""Faults that last the whole flight."""
FaultPart = Annotated[Sudden | FromStart, Field(discriminator="kind")]


def description(fault: Sudden) -> str:
    """Return what happens to the vehicle of ``fault``, as text of an event."""
    if isinstance(fault, Freeze):
        return "its companion hangs"
    if isinstance(fault, Vanish):
        return "its companion is gone for good"
    if isinstance(fault, Restart):
        return "its companion ends, and another one begins"
    if isinstance(fault, GpsLoss):
        return "its position fix is lost"
    if isinstance(fault, GpsJump):
        return "its position fix is {:g}, {:g}, {:g} m off".format(*fault.offset)
    if isinstance(fault, MotorFailure):
        return f"rotor {fault.rotor} gives {100.0 * fault.left:g} % of its thrust from now on"
    if isinstance(fault, UtcStep):
        return f"its autopilot's UTC steps by {fault.step_ms:g} ms"
    if isinstance(fault, ClockStep):
        return f"its computer's system clock steps by {fault.step_ms:g} ms"
    raise TypeError(fault)


class Clocks(Part):
    """Errors of the companions' clocks from the start: drawn per seed, uniform in ± these bounds."""

    offset_ms: float = Field(1.0, ge=0.0, le=1_000.0, description="ms, largest error at the start")
    drift_ppm: float = Field(20.0, ge=0.0, le=1_000.0, description="parts per million, largest drift")
    system_us: int | None = Field(
        None,
        ge=0,
        le=1_000_000,
        description="largest error of the system clocks after a correction; null: nobody disciplines them",
    )
