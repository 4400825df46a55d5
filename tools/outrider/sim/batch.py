"""Many vehicles of one type, advanced together by the compiled physics."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from outrider.arguments import number, whole
from outrider.errors import InputError
from outrider.resources import find
from outrider.sim.frames import enu_attitudes, forward_left_up, swapped, turned_yaw, yaw_of
from outrider.yaml_files.yaml_file import load
from sitl.vehicle.airframe import FloatArray, airframe, airframe_record
from sitl.vehicle.config import VehicleConfig
from sitl.vehicle.multirotor import advance_many, checked_rotor, initial_states
from sitl.vehicle.pipeline import COMMAND_SIZE, FLYING, LANDED, STATE_SIZE, STOPPED

_COLUMNS: Final = (3, 6, 9, 10, 11)
"""Numbers of columns of commands, see ``Batch.step``."""
_DEFAULT_SPACING_M, _DEFAULT_HEIGHT_M = 3.0, 5.0


def vehicle_config(vehicle: str | Path | VehicleConfig) -> VehicleConfig:
    """Return the type of vehicle with this name, or from this file. Raises InputError, also for a point."""
    if not isinstance(vehicle, str | Path | VehicleConfig):
        raise InputError(
            f"vehicle: is a {type(vehicle).__name__}; allowed: a name, a file, or a VehicleConfig"
        )
    config = (
        vehicle if isinstance(vehicle, VehicleConfig) else load(find("vehicles", str(vehicle)), VehicleConfig)
    )
    if config.motion == "point":
        raise InputError(f"vehicle {config.name}: a point has no physics; allowed is motion: multirotor")
    return config


class Batch:
    """``count`` vehicles over flat ground, each with its own controller; they do not touch each other.

    ``vehicle``: "firefly", "hummingbird", a file, or a ``VehicleConfig``. ``positions`` (K, 3), m, ENU; by
    default a square 3 m apart and 5 m high. ``yaws`` (K,), rad, counter-clockwise from east. They hover, or
    with ``hovering=False`` stand with their motors off. ``ground``: height of the ground, m. Raises
    InputError.

    A vehicle moves exactly, to the bit, as it would alone, whatever the others do.
    """

    def __init__(
        self,
        vehicle: str | Path | VehicleConfig = "firefly",
        count: int = 1,
        *,
        positions: ArrayLike | None = None,
        yaws: ArrayLike | None = None,
        hovering: bool = True,
        ground: float = 0.0,
    ) -> None:
        self.count = count = whole("count", count, least=1)
        self.config = config = vehicle_config(vehicle)
        self.dt = 1e-6 * config.physics_period
        """Length of a physics step, s."""
        self._ground = ground = number("ground", ground, "m")
        self._airframe = airframe_record(airframe(config))
        rotors = len(config.rotors)
        self._states = np.zeros((count, STATE_SIZE + 2 * rotors))
        self._commands = np.zeros((count, COMMAND_SIZE))
        self._commands[:, 22] = -ground
        self._rotors = slice(STATE_SIZE, STATE_SIZE + rotors)
        places = _square(count, ground) if positions is None else positions
        self.reset(positions=places, yaws=np.zeros(count) if yaws is None else yaws, hovering=hovering)

    def reset(
        self,
        which: ArrayLike | None = None,
        *,
        positions: ArrayLike,
        yaws: ArrayLike = 0.0,
        hovering: bool = True,
    ) -> None:
        """Place vehicles anew, at rest: all, or those ``which`` (indices (M,) or mask (K,)) selects.

        ``positions`` (M, 3) or (3,), m, ENU; ``yaws`` (M,) or one, rad. Raises InputError.
        """
        chosen = np.arange(self.count) if which is None else np.arange(self.count)[np.asarray(which)]
        places = _fitting("positions", positions, (len(chosen), 3), "m, ENU")
        headings = turned_yaw(_fitting("yaws", yaws, (len(chosen),), "rad"))
        try:
            rows = initial_states(self.config, swapped(places), headings, -self._ground, hovering=hovering)
        except ValueError as error:
            raise InputError(f"positions: {error}") from None
        self._states[chosen] = rows

    def step(
        self, commands: ArrayLike | None, steps: int = 1, *, wind: ArrayLike = (0.0, 0.0, 0.0)
    ) -> FloatArray:
        """Advance all vehicles by ``steps`` physics steps (``dt`` each), and return the positions (K, 3), m.

        ``commands`` (K, c), ENU: the position (m) that each vehicle shall have now (c = 3), and as far as
        given its velocity (6), acceleration (9), yaw (10, rad counter-clockwise from east) and yaw rate (11);
        between steps the position moves on with them. Without a yaw it is 0. Without ``commands`` the motors
        stop. ``wind`` (3,) or (K, 3): the air's velocity, m/s, ENU. Raises InputError for wrong shapes and
        values that are not finite; nothing has moved then.
        """
        steps = whole("steps", steps, least=1)
        rows = self._commands
        rows[:, 19:22] = swapped(_fitting("wind", wind, (self.count, 3), "m/s, ENU"))
        if commands is None:
            rows[:, 0] = STOPPED
        else:
            self._write(np.asarray(commands, dtype=np.float64))
        advance_many(self._states, rows, self._airframe, steps)
        return self.positions

    def _write(self, commands: FloatArray) -> None:
        """Write commands (K, c) into the rows of the physics. Raises InputError."""
        width = commands.shape[1] if commands.ndim == 2 else 0
        if commands.shape != (self.count, width) or width not in _COLUMNS:
            columns = ", ".join(map(str, _COLUMNS))
            raise InputError(
                f"commands: has shape {commands.shape}; allowed: ({self.count}, c) with c one of {columns}"
            )
        bad = ~np.isfinite(commands).all(axis=1)
        if bad.any():
            raise InputError(f"commands: row {int(bad.argmax())} is not finite; allowed: finite numbers")
        rows = self._commands
        rows[:, 0], rows[:, 1:19] = FLYING, 0.0
        for first in range(0, min(width, 9), 3):
            rows[:, 1 + first : 4 + first] = swapped(commands[:, first : first + 3])
        rows[:, 16] = turned_yaw(commands[:, 9]) if width > 9 else turned_yaw(np.zeros(self.count))
        if width > 10:
            rows[:, 17] = -commands[:, 10]

    def fail_rotor(self, vehicle: int, rotor: int, left: float) -> None:
        """Limit a rotor (0…n − 1) of a ``vehicle`` (0…K − 1) to the share ``left`` (0…1) of its speed.

        Its controller is not told. ``reset`` repairs it. Raises InputError.
        """
        try:
            checked_rotor(self.config, rotor, left)
            self._states[vehicle, self._rotors.stop + rotor] = left
        except (IndexError, ValueError) as error:
            raise InputError(str(error)) from None

    def save(self) -> FloatArray:
        """Return a copy of the whole state, for ``load``."""
        return self._states.copy()

    def load(self, state: FloatArray) -> None:
        """Continue from a ``state`` of ``save``; the motion is the same to the bit. Raises InputError."""
        self._states[:] = _fitting("state", state, self._states.shape, "from save()")

    @property
    def positions(self) -> FloatArray:
        """True positions (K, 3), m, ENU; a copy, as are all others."""
        return swapped(self._states[:, 0:3])

    @property
    def velocities(self) -> FloatArray:
        """True velocities (K, 3), m/s, ENU."""
        return swapped(self._states[:, 3:6])

    @property
    def accelerations(self) -> FloatArray:
        """Mean accelerations of the last physics step (K, 3), m/s², ENU."""
        return swapped(self._states[:, 13:16])

    @property
    def attitudes(self) -> FloatArray:
        """Attitudes (K, 4): quaternions w, x, y, z from the body (forward-left-up) to ENU."""
        return enu_attitudes(self._states[:, 6:10])

    @property
    def yaws(self) -> FloatArray:
        """Yaws (K,), rad, −π to π, counter-clockwise from east."""
        return yaw_of(self.attitudes)

    @property
    def body_rates(self) -> FloatArray:
        """Body rates (K, 3), rad/s, forward-left-up."""
        return forward_left_up(self._states[:, 10:13])

    @property
    def rotor_speeds(self) -> FloatArray:
        """Rotor speeds (K, n), rad/s."""
        left = slice(self._rotors.stop, None)
        return np.asarray(self._states[:, self._rotors] * self._states[:, left])

    @property
    def on_ground(self) -> NDArray[np.bool_]:
        """Whether each vehicle stands on the ground, (K,)."""
        return np.asarray(self._states[:, LANDED] != 0.0)


def _square(count: int, ground: float) -> FloatArray:
    """Return places (count, 3), m, on a square grid."""
    side = int(np.ceil(np.sqrt(count)))
    index = np.arange(count)
    across = _DEFAULT_SPACING_M * np.stack([index % side, index // side], axis=1)
    return np.column_stack([across, np.full(count, ground + _DEFAULT_HEIGHT_M)])


def _fitting(name: str, value: ArrayLike, shape: tuple[int, ...], unit: str) -> FloatArray:
    """Return ``value`` broadcast to ``shape``. Raises InputError for another shape, or what is not finite."""
    try:
        given = np.asarray(value, dtype=np.float64)
        found = np.array(np.broadcast_to(given, shape))
    except (TypeError, ValueError):
        raise InputError(f"{name}: has shape {np.shape(value)}; allowed: {shape}, {unit}") from None
    if not np.isfinite(found).all():
        raise InputError(f"{name}: holds a value that is not finite; allowed: finite numbers, {unit}")
    return found
