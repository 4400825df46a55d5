"""Battery model: rotor speeds in, voltage, current and charge out.

The power of a rotor is proportional to the cube of its speed. A cell's open-circuit voltage falls linearly
from 4.2 V when full to 3.5 V at a tenth of the charge, and from there to 3.0 V when empty, which approximates
a lithium polymer cell.
"""

from __future__ import annotations

from typing import Annotated, Final, NamedTuple

from pydantic import BaseModel, ConfigDict, Field

Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]

# Open-circuit voltages of a cell: full, at the knee of the curve, empty.
_FULL_V, _KNEE_V, _EMPTY_V = 4.2, 3.5, 3.0
_KNEE_CHARGE: Final = 0.1
_PERIOD_US: Final = 100_000


class BatteryConfig(BaseModel):
    """Properties of one battery. SI units, except the capacity, which is in mAh as printed on batteries."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    cells: int = Field(4, ge=1, le=10)
    capacity_mah: Positive = 5000.0
    remaining: float = Field(1.0, ge=0.0, le=1.0, description="at the start")
    hover_current: Positive = Field(20.0, description="A")
    idle_current: float = Field(0.5, ge=0.0, description="A, of all but the motors")
    resistance: float = Field(0.02, ge=0.0, description="ohm, of all cells")


class Charge(NamedTuple):
    """State of a battery.

    ``voltage`` (V, of all cells), ``current`` (A), ``consumed`` (A s), ``remaining`` (0…1), and ``lasts``,
    the time (s) until the battery is empty at this current (or 0.01 A, if that is greater).
    """

    voltage: float
    current: float
    consumed: float
    remaining: float
    lasts: float


class Battery:
    """Model of one battery, advanced in steps of at least 0.1 s."""

    def __init__(self, config: BatteryConfig, hover_speeds: list[float]) -> None:
        """``hover_speeds`` (rad/s): rotor speeds at which the motors draw ``hover_current``."""
        self._config = config
        self._hovering = sum(speed**3 for speed in hover_speeds)
        self._capacity = config.capacity_mah * 3.6
        self._left = self._capacity * config.remaining
        self._current = config.idle_current
        self._time = 0

    def due(self, now: int) -> bool:
        """Return whether a step ends by ``now`` (µs)."""
        return now - self._time >= _PERIOD_US

    def advance(self, now: int, speeds: list[float]) -> None:
        """Advance to ``now`` (µs), with the rotors turning at ``speeds`` (rad/s)."""
        share = sum(speed**3 for speed in speeds) / self._hovering
        self._current = self._config.idle_current + self._config.hover_current * share
        self._left = max(0.0, self._left - self._current * (now - self._time) * 1e-6)
        self._time = now

    def drain(self) -> None:
        """Empty the battery."""
        self._left = 0.0

    @property
    def charge(self) -> Charge:
        """Present state."""
        config, current = self._config, self._current
        remaining = self._left / self._capacity
        if remaining >= _KNEE_CHARGE:
            cell = _KNEE_V + (_FULL_V - _KNEE_V) * (remaining - _KNEE_CHARGE) / (1.0 - _KNEE_CHARGE)
        else:
            cell = _EMPTY_V + (_KNEE_V - _EMPTY_V) * remaining / _KNEE_CHARGE
        voltage = max(0.0, cell * config.cells - config.resistance * current)
        consumed = self._capacity * config.remaining - self._left
        return Charge(voltage, current, consumed, remaining, self._left / max(current, 0.01))
