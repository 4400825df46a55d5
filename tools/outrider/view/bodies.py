"""Bodies of the vehicles: frames, rotors that turn with the time of the flight, and shadows on the ground."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from outrider.palette import BODY, linear
from outrider.scene.airframe import Airframe
from outrider.scene.snapshot import Single, product
from outrider.view import shapes

if TYPE_CHECKING:
    import viser

TURNS = 1.7
"""Turns of a drawn rotor in a second of flight, as in the report: a real one would be a blur."""
MOST_TURNING = 64
"""Largest number of vehicles whose rotors have blades that turn; of a larger fleet discs are drawn."""
AWAY = (0.0, 0.0, -1e4)
IDENTITY = (1.0, 0.0, 0.0, 0.0)
_SHADOW_HEIGHT = 0.01
"""Height (m) of shadows, so that they lie above the grid."""
_HUB_HEIGHT = 0.05
"""Height of the rotors above the centre, as a share of the span."""


class Bodies:
    """Bodies of vehicles below ``name`` on ``stage``, ``size`` (m) across, with linear colours (K, 3)."""

    def __init__(
        self, stage: viser.SceneApi, name: str, airframe: Airframe, size: float, paint: NDArray[np.uint8]
    ) -> None:
        self._stage, self._name, self._size = stage, name, size
        count = len(paint)
        self._discs = self._many("rotors", shapes.rotors(airframe), paint, 0.75)
        self._frames = self._many("frames", shapes.frame(airframe), np.tile(linear(BODY), (count, 1)), None)
        self._noses = self._many("noses", shapes.nose(), paint, None)
        self._shadows = self._many("shadows", shapes.tile(), np.zeros((count, 3), np.uint8), 0.28)
        self._hubs = np.array([(x, y, _HUB_HEIGHT) for x, y in airframe.hubs])
        self._spins = np.array(airframe.spins)
        self._blades = None
        if count <= MOST_TURNING:
            dark = np.tile(linear(BODY), (count * len(self._hubs), 1))
            self._blades = self._many("blades", shapes.blades(airframe), dark, None)

    def show(self, time: float, place: Single, attitude: Single) -> None:
        """Show vehicles at ``place`` (K, 3) with ``attitude`` (K, 4), w x y z, at ``time`` (s)."""
        for handle in (self._discs, self._frames, self._noses):
            handle.batched_positions, handle.batched_wxyzs = place, attitude
        self._shadows.batched_positions = np.where(
            place[:, 2:] > AWAY[2],
            place * np.array((1.0, 1.0, 0.0), np.float32) + (0.0, 0.0, _SHADOW_HEIGHT),
            AWAY,
        ).astype(np.float32)
        if self._blades is not None:
            places, turned = blade_poses(place, attitude, self._size * self._hubs, self._spins, time)
            self._blades.batched_positions, self._blades.batched_wxyzs = places, turned

    def _many(
        self, part: str, mesh: shapes.Mesh, paint: NDArray[np.uint8], opacity: float | None
    ) -> viser.BatchedMeshHandle:
        count = len(paint)
        return self._stage.add_batched_meshes_simple(
            f"{self._name}/{part}",
            *mesh,
            batched_wxyzs=np.tile(IDENTITY, (count, 1)),
            batched_positions=np.tile(AWAY, (count, 1)),
            batched_scales=np.full(count, self._size),
            batched_colors=paint,
            opacity=opacity,
            side="double",
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
        )


def blade_poses(
    place: Single, attitude: Single, hubs: NDArray[np.float64], spins: NDArray[np.float64], time: float
) -> tuple[Single, Single]:
    """Return positions (K n, 3) and attitudes (K n, 4) of the blades of K vehicles with n rotors.

    ``place`` (K, 3), m; ``attitude`` (K, 4), w x y z; ``hubs`` (n, 3): rotors in body axes, m; ``spins``
    (n,): senses of rotation; ``time`` (s).
    """
    body = attitude.astype(np.float64)[:, None]
    half = np.pi * TURNS * time * spins + np.arange(len(spins))
    turned = np.stack([np.cos(half), 0.0 * half, 0.0 * half, np.sin(half)], axis=1)
    vectors = np.concatenate([np.zeros((len(hubs), 1)), hubs], axis=1)
    conjugate = body * (1.0, -1.0, -1.0, -1.0)
    offsets = product(product(body, vectors[None]), conjugate)[..., 1:]
    places = place[:, None] + offsets
    return places.reshape(-1, 3).astype(np.float32), product(body, turned[None]).reshape(-1, 4).astype(
        np.float32
    )
