"""One simulated vehicle."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from outrider.arguments import checked
from outrider.sim.batch import Batch
from sitl.vehicle.airframe import FloatArray
from sitl.vehicle.config import VehicleConfig

_ZERO = (0.0, 0.0, 0.0)


class VehicleState(NamedTuple):
    """True state of a vehicle: ENU, body forward-left-up, SI.

    ``position``, ``velocity``, ``acceleration`` (3,); ``attitude`` (4,): quaternion w, x, y, z from the body
    to ENU; ``body_rates`` (3,); ``yaw`` (rad); ``rotor_speeds`` (n,), rad/s; ``on_ground``.
    """

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    attitude: FloatArray
    body_rates: FloatArray
    yaw: float
    rotor_speeds: FloatArray
    on_ground: bool


class Vehicle:
    """One vehicle over flat ground: a ``Batch`` of one, whose arrays lack the first axis."""

    def __init__(
        self,
        vehicle: str | Path | VehicleConfig = "firefly",
        position: ArrayLike = (0.0, 0.0, 5.0),
        yaw: float = 0.0,
        *,
        hovering: bool = True,
        ground: float = 0.0,
    ) -> None:
        places = np.asarray(position, dtype=np.float64)
        self._batch = Batch(vehicle, 1, positions=places, yaws=[yaw], hovering=hovering, ground=ground)
        self.config, self.dt = self._batch.config, self._batch.dt

    def step(
        self,
        position: ArrayLike | None,
        velocity: ArrayLike = _ZERO,
        acceleration: ArrayLike = _ZERO,
        yaw: float = 0.0,
        yaw_rate: float = 0.0,
        *,
        steps: int = 1,
        wind: ArrayLike = _ZERO,
    ) -> FloatArray:
        """Advance by ``steps`` physics steps (``dt`` each) towards a set-point; return the position (3,), m.

        ``position``, ``velocity``, ``acceleration`` (3,), ENU, of the set-point now; ``yaw`` (rad) and its
        rate counter-clockwise from east. With ``position=None`` the motors stop. Raises InputError.
        """
        if position is None:
            command = None
        else:
            parts = (
                checked("position", position, (3,), "m"),
                checked("velocity", velocity, (3,), "m/s"),
                checked("acceleration", acceleration, (3,), "m/s²"),
                [yaw, yaw_rate],
            )
            command = np.concatenate(parts)[None]
        return np.ravel(self._batch.step(command, steps, wind=wind))

    def fail_rotor(self, rotor: int, left: float) -> None:
        """Limit a ``rotor`` to the share ``left`` (0…1) of its motor's speed. Raises InputError."""
        self._batch.fail_rotor(0, rotor, left)

    @property
    def state(self) -> VehicleState:
        """True state after the last step, as copies."""
        batch = self._batch
        return VehicleState(
            batch.positions[0],
            batch.velocities[0],
            batch.accelerations[0],
            batch.attitudes[0],
            batch.body_rates[0],
            float(batch.yaws[0]),
            batch.rotor_speeds[0],
            bool(batch.on_ground[0]),
        )
