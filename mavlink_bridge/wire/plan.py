"""Committed plan in at most 128 bytes of TUNNEL, in integers.

Sender and receiver hold the same numbers, bit for bit. A plan is piecewise constant acceleration a_n (n =
0…N−1) on knots epoch + n dt, from the state p_0, v_0, in fleet-local ENU. With accelerations in A = 1 mm/s²,
velocities in units of A dt and positions in units of ½ A dt², the exact motion over a knot, p' = p + v dt + ½
a dt², v' = v + a dt, is p' = p + 2v + a, v' = v + a in integers: nothing is ever rounded again.

A plan of kind ``COLUMN`` is one of a vehicle that may be at any height above and below it, because its
autopilot takes it off or lands it: others keep horizontal distances from it.

Sizes in bytes, little endian: kind 1, origin 1, dt/4 µs 2, epoch 7, position 3×4, velocity 3×3, then 3×2 for
each knot: 32 + 6 N bytes, N ≤ 16.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from struct import Struct
from struct import error as StructError  # noqa: N812
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from mavlink_bridge.errors import PlanWireError

PAYLOAD_TYPE = 0xDC01
"""TUNNEL.payload_type; values above 32767 are free for private use."""
KNOTS = 16
"""Largest number of knots N."""
KIND, COLUMN = 1, 2
"""Kinds: a plan in space, and one whose heights do not count."""
STEP = 4
"""Unit of dt (µs); dt is a whole multiple of it."""

Integers = tuple[int, int, int]
Array = npt.NDArray[np.float64]

_HEADER = Struct("<BBH7s3i9s")
_KNOT = Struct("<3h")
_KNOTS = [Struct(f"<{3 * n}h") for n in range(KNOTS + 1)]


class WirePlan(NamedTuple):
    """Plan in the integers of the wire.

    ``epoch`` and ``dt`` in µs; ``position``, ``velocity``, ``accelerations`` in the units of the module's
    docstring (fleet-local ENU); ``origin``: 8-bit fingerprint of that frame. ``column``: heights do not
    count, the vehicle may be at any.
    """

    epoch: int
    dt: int
    position: Integers
    velocity: Integers
    accelerations: tuple[Integers, ...]
    origin: int
    column: bool = False

    def states(self) -> npt.NDArray[np.int64]:
        """Return the exact position and velocity at every knot, (N+1, 2, 3), in wire units."""
        out = np.empty((len(self.accelerations) + 1, 2, 3), dtype=np.int64)
        velocities = out[:, 1]
        velocities[0] = self.velocity
        out[0, 0] = self.position
        if self.accelerations:
            a = np.array(self.accelerations, dtype=np.int64)
            velocities[1:] = velocities[0] + np.cumsum(a, axis=0)
            out[1:, 0] = out[0, 0] + np.cumsum(2 * velocities[:-1] + a, axis=0)
        return out

    def shifted(self, knots: int) -> WirePlan:
        """Return the rest of the same motion from knot ``knots`` (0…N) on.

        The epoch moves, the state advances exactly, and past accelerations are dropped. Nothing is appended:
        the plan gets shorter. Raises PlanWireError for ``knots`` outside 0…N.
        """
        if not 0 <= knots <= len(self.accelerations):
            raise PlanWireError(f"shift by {knots} knots of a plan that has {len(self.accelerations)}")
        px, py, pz = self.position
        vx, vy, vz = self.velocity
        for ax, ay, az in self.accelerations[:knots]:
            px, py, pz = px + 2 * vx + ax, py + 2 * vy + ay, pz + 2 * vz + az
            vx, vy, vz = vx + ax, vy + ay, vz + az
        return WirePlan(
            self.epoch + knots * self.dt,
            self.dt,
            (px, py, pz),
            (vx, vy, vz),
            self.accelerations[knots:],
            self.origin,
            self.column,
        )

    def at_height(self, height: float) -> WirePlan:
        """Return the same plan at rest at ``height`` (m, rounded to the wire), with heights that count."""
        x, y, _ = self.position
        position = x, y, round(height / _position_unit(self.dt))
        return self._replace(position=position, column=False)

    @property
    def position_m(self) -> Array:
        """Position (3,) at the epoch, m."""
        return np.array(self.position, dtype=np.float64) * _position_unit(self.dt)

    @property
    def velocity_m_s(self) -> Array:
        """Velocity (3,) at the epoch, m/s."""
        return np.array(self.velocity, dtype=np.float64) * _velocity_unit(self.dt)

    @property
    def accelerations_m_s2(self) -> Array:
        """Accelerations (N, 3), m/s², constant from each knot to the next."""
        # A third of the time of an array of tuples.
        flat = np.fromiter(chain.from_iterable(self.accelerations), np.float64, 3 * len(self.accelerations))
        return flat.reshape(-1, 3) * 1e-3

    def positions_m(self) -> Array:
        """Return the positions (N+1, 3) at the knots, m."""
        return self.states()[:, 0].astype(np.float64) * _position_unit(self.dt)

    def velocities_m_s(self) -> Array:
        """Return the velocities (N+1, 3) at the knots, m/s."""
        return self.states()[:, 1].astype(np.float64) * _velocity_unit(self.dt)


def _position_unit(dt: int) -> float:
    """Return ½ A dt² in m."""
    return 0.5e-3 * (dt * 1e-6) ** 2


def _velocity_unit(dt: int) -> float:
    """Return A dt in m/s."""
    return 1e-3 * (dt * 1e-6)


def _check_step(dt: int) -> None:
    if dt <= 0 or dt % STEP:
        raise PlanWireError(f"dt = {dt} µs is not a positive multiple of {STEP} µs")


def quantise(
    epoch: int,
    dt: int,
    position: npt.ArrayLike,
    velocity: npt.ArrayLike,
    accelerations: npt.ArrayLike,
    origin: int,
) -> WirePlan:
    """Return the plan in wire units nearest to position (3,) m, velocity (3,) m/s, accelerations (n, 3) m/s².

    Each number is rounded by half a unit at most, hence a position at knot n by at most (½ + n + ½n²) ·
    ½ A dt² (0.72 mm after 16 knots of 0.1 s). Raises PlanWireError for a wrong shape or
    dt, and for a number that is not finite or out of range.
    """
    px, py, pz, vx, vy, vz, *rest = _in_wire_units(dt, position, velocity, accelerations).tolist()
    knots = tuple(zip(rest[::3], rest[1::3], rest[2::3], strict=True))
    plan = WirePlan(int(epoch), int(dt), (px, py, pz), (vx, vy, vz), knots, origin)
    pack(plan)
    return plan


def _in_wire_units(
    dt: int, position: npt.ArrayLike, velocity: npt.ArrayLike, accelerations: npt.ArrayLike
) -> npt.NDArray[np.int64]:
    """Return position, velocity and accelerations (6 + 3 n,), rounded to the units of the wire."""
    _check_step(dt)
    p, v, a = (np.asarray(part, dtype=np.float64) for part in (position, velocity, accelerations))
    if p.shape != (3,) or v.shape != (3,) or a.ndim != 2 or a.shape[1] != 3:
        raise PlanWireError(f"shapes {p.shape}, {v.shape}, {a.shape} are not (3,), (3,), (n, 3)")
    scaled = np.concatenate((p / _position_unit(dt), v / _velocity_unit(dt), a.ravel() / 1e-3))
    # Beyond int64 the cast is undefined; the wire's own limits are far below and are checked when packing.
    if not np.abs(scaled).max() < 2.0**62:
        raise PlanWireError(f"not finite, or far out of range: {position!r}, {velocity!r}, {accelerations!r}")
    return np.rint(scaled).astype(np.int64)


def pack(plan: WirePlan) -> bytes:
    """Encode ``plan`` in 32 + 6 N bytes; raise PlanWireError for a value that does not fit."""
    epoch, dt, position, velocity, accelerations, origin, column = plan
    numbers = *position, *velocity, *chain.from_iterable(accelerations)
    return _packed(epoch, dt, numbers, origin, COLUMN if column else KIND)


def packed(
    epoch: int,
    dt: int,
    position: npt.ArrayLike,
    velocity: npt.ArrayLike,
    accelerations: npt.ArrayLike,
    origin: int,
) -> bytes:
    """Return what ``pack`` returns for the plan of ``quantise``; raise PlanWireError as these do."""
    numbers = _in_wire_units(dt, position, velocity, accelerations).tolist()
    return _packed(int(epoch), int(dt), numbers, origin)


def _packed(epoch: int, dt: int, numbers: Sequence[int], origin: int, kind: int = KIND) -> bytes:
    """Encode a plan of ``kind``.

    ``numbers``: position, velocity and accelerations (6 + 3 N,) in wire units.
    """
    knots = (len(numbers) - 6) // 3
    if knots > KNOTS:
        raise PlanWireError(f"{knots} knots are more than {KNOTS}")
    _check_step(dt)
    try:
        speed = b"".join(v.to_bytes(3, "little", signed=True) for v in numbers[3:6])
        header = _HEADER.pack(kind, origin, dt // STEP, epoch.to_bytes(7, "little"), *numbers[:3], speed)
        return header + _KNOTS[knots].pack(*numbers[6:])
    except (OverflowError, StructError):
        raise PlanWireError(
            f"out of range of the wire: epoch {epoch}, dt {dt}, origin {origin}, {numbers}"
        ) from None


class PlannedMotion(NamedTuple):
    """Plan in SI units: ``position`` (3,), m, and ``velocity`` (3,), m/s, at the epoch.

    ``accelerations`` (N, 3), m/s²; ``epoch``, ``dt`` and ``origin`` as in ``WirePlan``.
    """

    epoch: int
    dt: int
    position: Array
    velocity: Array
    accelerations: Array
    origin: int


def unpack_motion(data: bytes) -> PlannedMotion:
    """Decode a plan to SI units; raise PlanWireError for anything that ``pack`` cannot produce.

    The numbers are those of the properties of ``WirePlan``.
    """
    epoch, dt, position, velocity, origin, _ = _head(data)
    return PlannedMotion(
        epoch,
        dt,
        np.array(position, dtype=np.float64) * _position_unit(dt),
        np.array(velocity, dtype=np.float64) * _velocity_unit(dt),
        np.frombuffer(data, dtype="<i2", offset=_HEADER.size).reshape(-1, 3) * 1e-3,
        origin,
    )


def unpack(data: bytes) -> WirePlan:
    """Decode the plan in a TUNNEL payload; raise PlanWireError for anything that ``pack`` cannot produce."""
    epoch, dt, position, velocity, origin, column = _head(data)
    knots = tuple(_KNOT.iter_unpack(data[_HEADER.size :]))
    return WirePlan(epoch, dt, position, velocity, knots, origin, column)


def _head(data: bytes) -> tuple[int, int, Integers, Integers, int, bool]:
    """Return all of a plan in a TUNNEL payload but its accelerations; check its length."""
    knots, rest = divmod(len(data) - _HEADER.size, _KNOT.size)
    if rest or not 0 <= knots <= KNOTS:
        raise PlanWireError(f"{len(data)} bytes are not a plan")
    kind, origin, steps, epoch, px, py, pz, velocity = _HEADER.unpack_from(data)
    if kind not in (KIND, COLUMN):
        raise PlanWireError(f"kind {kind} is not a plan of kind {KIND} or {COLUMN}")
    if steps == 0:
        raise PlanWireError("a plan with dt = 0")
    speed = (
        int.from_bytes(velocity[0:3], "little", signed=True),
        int.from_bytes(velocity[3:6], "little", signed=True),
        int.from_bytes(velocity[6:9], "little", signed=True),
    )
    return int.from_bytes(epoch, "little"), steps * STEP, (px, py, pz), speed, origin, kind == COLUMN
