"""Cameras of the browsers: the whole scene, or from above."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from outrider.view.trails import GAP

if TYPE_CHECKING:
    import viser

Array = NDArray[np.floating]

AZIMUTH, ELEVATION, FIELD = -1.15, 0.5, float(np.radians(40.0))
"""Direction of the whole scene, as in the report, and the vertical field of view (rad)."""
TOP_FIELD = float(np.radians(0.2))
"""Vertical field of view (rad) from above: so narrow that a height as large as the scene's reach shifts a
vehicle by less than 0.2 % of its distance from the middle. Viser 1 has cameras with perspective only."""
_TOP_NEAR = 0.1
"""Nearest depth from above, as a share of the camera's distance: the picture can be enlarged ten times."""
_ROOM = 1.05
_SHARE = 0.15
"""Part of the way to the vehicles that the middle of the picture moves for one snapshot."""


def distance(reach: float, field: float, aspect: float) -> float:
    """Return the distance (m) from which a scene fits into a picture.

    ``reach`` (m): radius of the scene; ``field`` (rad): vertical field of view; ``aspect``: width over height
    of the picture.
    """
    return float(_ROOM * reach / np.tan(0.5 * field) * max(1.0, 1.0 / max(aspect, 0.1)))


def whole(camera: viser.CameraHandle | viser.InitialCameraConfig, reach: float, aspect: float = 1.0) -> None:
    """Aim ``camera`` so that the whole scene is in the picture."""
    level = np.cos(ELEVATION)
    direction = np.array([np.cos(AZIMUTH) * level, np.sin(AZIMUTH) * level, np.sin(ELEVATION)])
    _aim(camera, reach, FIELD, distance(reach, FIELD, aspect) * direction)


def above(camera: viser.CameraHandle, reach: float, aspect: float) -> None:
    """Aim ``camera`` down at the scene, with north up."""
    height = distance(reach, TOP_FIELD, aspect)
    # Not quite straight down: there the direction to the north would be undefined.
    _aim(camera, reach, TOP_FIELD, np.array([0.0, -1e-4 * height, height]))


def followed(focus: Array, middle: Array, elapsed: float) -> Array:
    """Return where the middle of the picture (3,) moves from ``focus`` (3,) to follow ``middle`` (3,), m.

    It moves a part of the way, so that the picture does not shake; all of it where the time of the flight
    jumped: ``elapsed`` (s) since the snapshot before is negative or long.
    """
    return middle if not 0.0 <= elapsed <= GAP else focus + _SHARE * (middle - focus)


def _aim(
    camera: viser.CameraHandle | viser.InitialCameraConfig, reach: float, field: float, place: np.ndarray
) -> None:
    far = float(np.linalg.norm(place))
    camera.fov = field
    # A narrow field is seen from far away: the depths that can be told apart begin near the scene.
    camera.near = max(0.01, _TOP_NEAR * far) if field == TOP_FIELD else 0.01
    camera.far = far + 100.0 * reach
    # In this order: a new position takes the point that is looked at with it.
    camera.position = place
    camera.look_at = (0.0, 0.0, 0.0)
