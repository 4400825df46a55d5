"""Simulated multirotor with its controller: reference in, true motion out."""

from __future__ import annotations

import math
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mavlink_bridge.messages import Vector
from sitl.vehicle.airframe import FloatArray, airframe, airframe_record, hover_speeds
from sitl.vehicle.batch import advance_rows
from sitl.vehicle.config import VehicleConfig
from sitl.vehicle.ground import GRAVITY
from sitl.vehicle.pipeline import COMMAND_SIZE, FLYING, IDLE, LANDED, STATE_SIZE, STOPPED

_ZERO = np.zeros(3)
_ZERO.flags.writeable = False


class Reference(NamedTuple):
    """Motion to follow from now on, extrapolated with all given derivatives."""

    position: FloatArray  # (3,) m, NED
    velocity: FloatArray = _ZERO  # (3,) m/s, NED
    acceleration: FloatArray = _ZERO  # (3,) m/s², NED
    jerk: FloatArray = _ZERO  # (3,) m/s³, NED
    snap: FloatArray = _ZERO  # (3,) m/s⁴, NED
    yaw: float = 0.0  # rad, clockwise from north
    yaw_rate: float = 0.0  # rad/s
    yaw_acceleration: float = 0.0  # rad/s²

    @classmethod
    def hover(cls, position: ArrayLike, yaw: float = 0.0) -> Self:
        """Return the reference that holds a position (3,) (m, NED) with a heading (rad)."""
        return cls(np.asarray(position, dtype=np.float64), yaw=yaw)

    def ahead(self, elapsed: int) -> Self:
        """Return the same motion ``elapsed`` µs later, by its Taylor polynomial."""
        t = elapsed * 1e-6
        x, v, a, j, s, yaw, yaw_rate, yaw_acceleration = self
        return self._replace(
            position=x + t * (v + t / 2.0 * (a + t / 3.0 * (j + t / 4.0 * s))),
            velocity=v + t * (a + t / 2.0 * (j + t / 3.0 * s)),
            acceleration=a + t * (j + t / 2.0 * s),
            jerk=j + t * s,
            yaw=yaw + t * (yaw_rate + t / 2.0 * yaw_acceleration),
            yaw_rate=yaw_rate + t * yaw_acceleration,
        )


class VehicleState(NamedTuple):
    """True state of a vehicle; the arrays are copies, which later steps do not change."""

    position: FloatArray  # (3,) m, NED
    velocity: FloatArray  # (3,) m/s, NED
    attitude: FloatArray  # (4,) w, x, y, z, body (FRD) to NED
    body_rates: FloatArray  # (3,) rad/s, FRD
    rotor_speeds: FloatArray  # (n,) rad/s
    acceleration: FloatArray  # (3,) m/s², NED, mean of the last physics step; 0 at rest
    learnt_force: FloatArray = _ZERO  # (3,) N, NED, estimate of wind and faults; the controller cancels it


class NotFiniteError(ValueError):
    """Reference or wind that is not finite; the vehicle has not moved."""


def initial_states(
    config: VehicleConfig,
    positions: ArrayLike,
    yaws: ArrayLike,
    ground: float,
    *,
    hovering: bool = False,
    gravity: float = GRAVITY,
) -> FloatArray:
    """Return state rows (K, STATE_SIZE + 2 n) of vehicles at rest.

    The motors are off or, if ``hovering``, at hover speed. Positions (K, 3) in m, NED; yaws (K,) in rad;
    ``ground`` is the NED z (m). A vehicle on or below the ground is placed on its gear there. Raises
    ValueError for such a vehicle if ``hovering``.
    """
    places = np.atleast_2d(np.asarray(positions, dtype=np.float64))
    half_yaws = 0.5 * np.asarray(yaws, dtype=np.float64)
    n = len(config.rotors)
    states = np.zeros((len(places), STATE_SIZE + 2 * n))
    states[:, STATE_SIZE + n :] = 1.0
    floor = ground - config.rest_height
    states[:, 0:3] = places
    states[:, 2] = np.minimum(places[:, 2], floor)
    states[:, 6], states[:, 9] = np.cos(half_yaws), np.sin(half_yaws)
    states[:, LANDED] = places[:, 2] >= floor
    if hovering:
        if np.any(states[:, LANDED]):
            k = int(np.argmax(places[:, 2]))
            raise ValueError(
                f"vehicle {k} cannot hover at z = {places[k, 2]:g} m, NED: it must be less than {floor:g} m"
            )
        states[:, STATE_SIZE : STATE_SIZE + n] = hover_speeds(config, gravity)
    return states


def command_row(
    reference: Reference | None, *, idle: bool = False, wind: ArrayLike = _ZERO, ground: float = 0.0
) -> FloatArray:
    """Return the command row (COMMAND_SIZE,) for ``advance_many``.

    ``ground`` is the z of the ground (m, NED); other arguments as for ``Vehicle.advance``.
    """
    row = np.zeros(COMMAND_SIZE)
    write_command(row, reference, idle, wind, ground)
    return row


def write_command(
    row: FloatArray, reference: Reference | None, idle: bool, wind: ArrayLike, ground: float
) -> None:
    """Fill a command row (COMMAND_SIZE,) in place."""
    if reference is None:
        row[0] = IDLE if idle else STOPPED
    else:
        row[0] = FLYING
        row[1:4], row[4:7], row[7:10], row[10:13], row[13:16], row[16], row[17], row[18] = reference
    row[19:22] = wind
    row[22] = ground


def advance_many(
    states: FloatArray, commands: FloatArray, airframes: NDArray[np.void], steps: int
) -> FloatArray:
    """Advance K vehicles of one type in place; return the positions (K, steps, 3) after each physics step.

    ``states`` (K, STATE_SIZE + 2 n) and ``commands`` (K, COMMAND_SIZE) are rows as in ``pipeline``,
    C-contiguous float64; ``airframes`` comes from ``airframe_record``. Each vehicle moves exactly, to the
    bit, as it would alone. Raises NotFiniteError.
    """
    tracks = np.empty((states.shape[0], 3 * steps))
    bad = advance_rows(states, commands, airframes, steps, tracks)
    if bad >= 0:
        raise NotFiniteError(f"the command of vehicle {bad} is not finite: {commands[bad].tolist()}")
    return tracks.reshape(-1, steps, 3)


def state_of(row: FloatArray) -> VehicleState:
    """Return copies of the values in a state row (STATE_SIZE + 2 n,).

    The speed of a failed rotor is the remaining fraction of its motor's speed.
    """
    row = row.copy()
    left = (STATE_SIZE + len(row)) // 2
    rotor_speeds = row[STATE_SIZE:left] * row[left:]
    return VehicleState(row[0:3], row[3:6], row[6:10], row[10:13], rotor_speeds, row[13:16], row[20:23])


def checked_rotor(config: VehicleConfig, index: int, left: float) -> None:
    """Check the arguments of a rotor failure.

    Raises IndexError if the vehicle has no such rotor, ValueError if ``left`` is not 0 to 1.
    """
    n = len(config.rotors)
    if not 0 <= index < n:
        raise IndexError(f"rotor {index} of {config.name}: its rotors are 0 to {n - 1}")
    if not 0.0 <= left <= 1.0:
        raise ValueError(f"rotor {index} of {config.name}: {left} left, allowed is 0 to 1")


class Vehicle:
    """One vehicle over flat ground, with our own physics."""

    def __init__(
        self,
        config: VehicleConfig,
        position: ArrayLike,
        yaw: float = 0.0,
        ground: float = 0.0,
        gravity: float = GRAVITY,
        *,
        hovering: bool = False,
    ) -> None:
        """Start at rest with motors off, or in the air at hover speed if ``hovering``.

        ``position`` (3,) and the z of the ``ground`` in m, NED, ``yaw`` in rad, ``gravity`` in m/s². Raises
        ValueError for a hover position that is not above the ground.
        """
        self.config = config
        self._airframe = airframe_record(airframe(config, gravity))
        self._states = initial_states(config, position, [yaw], ground, hovering=hovering, gravity=gravity)
        self._commands = np.zeros((1, COMMAND_SIZE))
        self._state, self._command = self._states[0], self._commands[0]
        self._left = self._state[STATE_SIZE:].reshape(2, -1)[1]
        self._ground = ground

    def advance(
        self, steps: int, reference: Reference | None, wind: ArrayLike = _ZERO, *, idle: bool = False
    ) -> FloatArray:
        """Advance by ``steps`` physics steps; return the true positions (steps, 3) (m, NED) after each.

        The reference is valid at the beginning of the first step. None stops the motors, or with ``idle``
        lets them turn slowly. ``wind`` (3,) is the velocity of the air (m/s, NED). Raises NotFiniteError.
        """
        write_command(self._command, reference, idle, wind, self._ground)
        track: FloatArray = advance_many(self._states, self._commands, self._airframe, steps)[0]
        return track

    def fail_rotor(self, index: int, left: float) -> None:
        """Limit the rotor ``index`` (0…n−1) to the fraction ``left`` (0…1) of its motor's speed from now on.

        The rotor's thrust and drag torque decrease with the square of ``left``. The controller receives no
        indication. Raises IndexError and ValueError.
        """
        checked_rotor(self.config, index, left)
        self._left[index] = left

    @property
    def state(self) -> VehicleState:
        """True state after the last step."""
        return state_of(self._state)

    @property
    def yaw(self) -> float:
        """Heading (rad, −π…π, clockwise from north)."""
        w, x, y, z = self._state[6:10].tolist()
        return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))

    @property
    def on_ground(self) -> bool:
        """Whether the vehicle stands on the ground after the last step."""
        return bool(self._state[LANDED])

    @property
    def air(self) -> Vector:
        """Velocity of the air (m/s, NED) in the last step."""
        north, east, down = self._command[19:22].tolist()
        return north, east, down
