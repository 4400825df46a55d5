"""Settings of the estimation of tracks."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from companion.values.settings import Positive, Settings

Micros = Annotated[int, Field(gt=0, le=10_000_000, multiple_of=4)]


class TrackConfig(Settings):
    """Track of one sender, filtered by a Kalman filter."""

    sigma_position: Positive = Field(0.02, description="m")
    sigma_velocity: Positive = Field(0.05, description="m/s")
    sigma_acceleration: Positive = Field(2.0, description="m/s², of the constant-velocity model")
    sigma_turn: float = Field(
        0.0,
        ge=0.0,
        le=10.0,
        description="rad/s, of the rates at which its course turns; 0: it goes straight; of neighbours it"
        " counts only for those that share no plan, beside committed plans",
    )
    turn_memory_us: Micros = Field(
        3_000_000, description="µs: time constant with which the turn rate decays to 0"
    )
    delay_us: int = Field(
        20_000, ge=0, le=2_000_000, description="least age of a message when it arrives; jitter adds to it"
    )
    stamps: bool = Field(True, description="date by the sender's time_boot_ms; false: by the arrival alone")
    rewind_us: int = Field(
        2_000_000,
        ge=0,
        le=10_000_000,
        description="µs by which a message may be late and still be inserted at its time",
    )
    extrapolate_us: Micros = Field(1_000_000, description="µs: no track is extrapolated for longer")
    gate: Positive = Field(
        22.46, description="on d² = yᵀS⁻¹y, χ² of six: 16.81 passes 99 % of what is true, 22.46 99.9 %"
    )
    jump: Positive = Field(
        3.0, description="m and m/s: limit of the innovation; it grows by as much per second without a state"
    )
    witnesses: int = Field(
        2,
        ge=1,
        le=10,
        description="number of successive refused measurements that must agree to restart the track",
    )
    velocity_up: bool = Field(False, description="the sender's vz is positive up, contrary to MAVLink")
