"""Vehicle with JSBSim's physics and our controller."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mavlink_bridge.messages import Vector
from sitl.backends.jsbsim_engine import STILL, Air, Engine
from sitl.backends.jsbsim_pilot import sense, steer
from sitl.backends.jsbsim_place import Place
from sitl.backends.physics import BackendError
from sitl.vehicle.airframe import FloatArray, airframe, airframe_record
from sitl.vehicle.config import VehicleConfig
from sitl.vehicle.ground import GRAVITY
from sitl.vehicle.multirotor import (
    NotFiniteError,
    Reference,
    VehicleState,
    checked_rotor,
    state_of,
    write_command,
)
from sitl.vehicle.pipeline import COMMAND_SIZE, LANDED


class JsbsimVehicle:
    """One vehicle over JSBSim's Earth, as a ``Physics``.

    In each step the controller takes the present motion of JSBSim, and JSBSim advances under its commands:
    the only delay between them is the motors' own lag.
    """

    def __init__(
        self,
        config: VehicleConfig,
        place: Place,
        state: FloatArray,
        ground: float,
        gravity: float = GRAVITY,
        air: Air = STILL,
    ) -> None:
        """Start at a ``state`` row, as made by ``vehicle.initial_states``, over ``ground`` (z, m, NED).

        ``gravity`` (m/s²) is the controller's value; JSBSim has its own. Raises BackendError.
        """
        self.config = config
        self._airframe = airframe_record(airframe(config, gravity))
        self._state = state.copy()
        self._command = np.zeros(COMMAND_SIZE)
        self._commanded = np.zeros(len(config.rotors))
        self._ground = ground
        self._engine = Engine(config, place, self._state, ground, air)

    def advance(
        self,
        steps: int,
        reference: Reference | None,
        wind: ArrayLike = (0.0, 0.0, 0.0),
        *,
        idle: bool = False,
    ) -> FloatArray:
        """Advance as defined by ``Physics``.

        JSBSim takes the wind in the NED of the vehicle's place. The tilt of that frame against the site's
        NED, 0.16 mrad per km from the site's origin, is neglected.
        """
        command, state, engine = self._command, self._state, self._engine
        write_command(command, reference, idle, wind, self._ground)
        if not np.all(np.isfinite(command)):
            raise NotFiniteError(f"the command of {self.config.name} is not finite: {command.tolist()}")
        blowing = command[19:22].tolist()
        step = self.config.physics_period * 1e-6
        track = np.empty((steps, 3))
        for i in range(steps):
            steer(state, command, self._airframe, i * step, self._commanded)
            engine.step(self._commanded.tolist(), blowing)
            if not sense(state, engine.measured, engine.place, command, self._airframe):
                measured = engine.measured.tolist()
                raise BackendError(
                    f"JSBSim's {self.config.name} is not finite at {engine.time:.4f} s: {measured}"
                )
            track[i] = state[0:3]
        return track

    def fail_rotor(self, index: int, left: float) -> None:
        """Fail a rotor as defined by ``Physics``."""
        checked_rotor(self.config, index, left)
        self._state[-len(self.config.rotors) + index] = left
        self._engine.leave(index, left)

    @property
    def measured(self) -> FloatArray:
        """Copy of JSBSim's measurements after the last step, a row of ``jsbsim_engine``."""
        return self._engine.measured.copy()

    @property
    def state(self) -> VehicleState:
        """True state after the last step."""
        return state_of(self._state)

    @property
    def on_ground(self) -> bool:
        """Whether the vehicle touches the ground after the last step."""
        return bool(self._state[LANDED])

    @property
    def air(self) -> Vector:
        """Velocity of the air (m/s, NED), with JSBSim's turbulence."""
        return self._engine.air
