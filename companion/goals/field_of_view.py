"""Stand-off at which a camera has the target inside its field of view, with a margin.

The margin is the angle under which k·σ of the target's estimated position appears. A camera with a fixed
pitch moves towards or away from the target until the target's elevation is inside; then, if its field of view
is still narrower than the margin, it moves away along its ray, up to a limit.
"""

from __future__ import annotations

from math import asin, atan2, hypot, radians, tan

from companion.config.formation import FieldOfView
from companion.values.horizon import Array

_STEEPEST = radians(89.0)
"""Largest elevation of a ray that is used, rad."""


def in_view(config: FieldOfView, offset: Array, sigma: float) -> Array:
    """Return the offset (3,), m, from the target at which the target stays inside the field of view.

    It is at the bearing of ``offset`` (3,), m, of a point on the surface, and at most ``farthest`` times as
    far from the target. ``sigma`` (m): σ of the target's position on its worst axis. The height is kept,
    unless the camera has to move away along its ray. A target that is not below the camera is not moved for.
    """
    across, up = hypot(offset[0], offset[1]), float(offset[2])
    if across == 0.0 or up <= 0.0:
        return offset
    size = config.sigmas * sigma
    longest = config.farthest * hypot(across, up)
    half = 0.5 * radians(config.height_deg)
    wanted = across
    off_axis = 0.0
    if config.pitch_deg is not None:
        pitch = radians(config.pitch_deg)
        # The margin at the least distance of this height is enough at every other. With less room than that
        # the target is kept on the optical axis.
        room = max(half - atan2(size, up), 0.0)
        elevation = min(max(atan2(up, across), pitch - room), pitch + room)
        elevation = min(max(elevation, asin(up / longest)), _STEEPEST)
        wanted = up / tan(elevation)
        off_axis = abs(elevation - pitch)
    narrowest = min(half - off_axis, 0.5 * radians(config.width_deg))
    distance = hypot(wanted, up)
    needed = size / tan(max(narrowest, 1e-6))
    further = min(max(distance, needed), max(distance, longest)) / distance
    result: Array = offset.copy()
    result[:2] *= wanted * further / across
    result[2] *= further
    return result
