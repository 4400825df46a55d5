"""Settings of autonomous behaviour: battery failsafe, fence, following a leader."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat


class BatteryFailsafeConfig(BaseModel):
    """Battery failsafe: thresholds and actions. PX4 uses the remaining charge, ArduPilot the voltage."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    low: float = Field(0.15, ge=0.0, le=1.0, description="PX4: share that is left; also told by both")
    critical: float = Field(0.07, ge=0.0, le=1.0)
    emergency: float = Field(0.05, ge=0.0, le=1.0)
    action: Literal["warn", "land", "return"] = Field("warn", description="PX4, when critical")
    low_voltage: float = Field(10.5, ge=0.0, description="ArduPilot: V, of all cells; 0: none")
    critical_voltage: float = Field(0.0, ge=0.0)
    low_action: Literal["warn", "land", "return"] = Field("warn", description="ArduPilot")
    critical_action: Literal["warn", "land", "return"] = "warn"


class FenceConfig(BaseModel):
    """Fence: conditions of a breach beside uploaded areas, and the action.

    A setting that is None takes the firmware's default.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    enabled: Literal["off", "on"] = Field("off", description="ArduPilot's FENCE_ENABLE; PX4's is always on")
    kinds: float = Field(
        7.0,
        ge=0.0,
        le=15.0,
        description="ArduPilot's FENCE_TYPE, a sum: 1 height, 2 radius, 4 areas, 8 floor",
    )
    floor: float = Field(-10.0, description="above home at least (m), where FENCE_TYPE has it; ArduPilot")
    height: float | None = Field(None, ge=0.0, description="above home at most (m); 0: any")
    radius: float | None = Field(None, ge=0.0, description="from home at most (m); 0: any")
    action: Literal["nothing", "warn", "hold", "return", "land", "terminate"] | None = None


class FollowConfig(BaseModel):
    """Leader to follow, and the station relative to it.

    The settings are ArduPilot's ``FOLL_`` and PX4's ``FLW_TGT_`` parameters.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    enabled: Literal["off", "on"] = Field("off", description="ArduPilot; PX4 can always")
    system: float = Field(0.0, ge=0.0, le=255.0, description="id of the one to follow; 0: the first heard")
    limit: float = Field(100.0, gt=0.0, description="further off it is not followed (m); ArduPilot")
    axes: Literal["north", "heading"] = Field("north", description="of x and y; ArduPilot")
    x: FiniteFloat = Field(0.0, description="offset north or ahead (m); all three 0: as it is at first")
    y: FiniteFloat = Field(0.0, description="east or to the right")
    z: FiniteFloat = Field(0.0, description="down")
    distance: float = Field(8.0, ge=1.0, description="PX4 (m)")
    angle: float = Field(180.0, ge=-180.0, le=180.0, description="PX4: from its course, 180 behind (degrees)")
    height: float = Field(8.0, ge=1.0, description="PX4: above home (m)")
    patience: float = Field(3.0, gt=0.0, description="of silence (s); then it stops")
