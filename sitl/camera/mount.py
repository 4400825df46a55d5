"""Mounts: attitude and place of a camera on its vehicle.

The attitude of a body-fixed camera follows from the vehicle's. A gimbal measures roll and pitch of the camera
itself, so the tilt errors of the vehicle's estimate are not in its attitude; its yaw is the vehicle's.
"""

from __future__ import annotations

import math

from mavlink_bridge.pinhole import Quaternion, Vector, product, rotated
from sitl.values.attitudes import euler, quaternion
from sitl.values.camera import FixedMount, GimbalMount


class Mount:
    """Mount with its present ``pitch`` (rad, of the optical axis above the horizon or above the nose)."""

    def __init__(self, config: FixedMount | GimbalMount) -> None:
        self._config = config
        self.pitch = -math.radians(config.pitch_deg)
        self._ordered = self._wanted = self.pitch
        self.on_gimbal = isinstance(config, GimbalMount)

    def turn(self, pitch: float) -> bool:
        """Turn to ``pitch`` (rad, above the horizon), as far as the gimbal can; return False without one."""
        if not self.on_gimbal:
            return False
        self._ordered = self._wanted = self._within(pitch)
        return True

    def follow(self, pitch: float) -> None:
        """Turn to ``pitch`` (rad, above the horizon) if the gimbal follows what is detected."""
        if isinstance(self._config, GimbalMount) and self._config.follows:
            self._wanted = self._within(pitch)

    def search(self) -> None:
        """Return to the first pitch, or to the last ordered one: nothing is detected."""
        self._wanted = self._ordered

    def _within(self, pitch: float) -> float:
        config = self._config
        if isinstance(config, FixedMount):
            return pitch
        low, high = -math.radians(config.lowest_deg), -math.radians(config.highest_deg)
        return max(low, min(high, pitch))

    def advance(self, seconds: float) -> None:
        """Turn for ``seconds`` towards the wanted pitch, at the gimbal's rate."""
        if isinstance(self._config, GimbalMount):
            most = math.radians(self._config.rate_deg_s) * seconds
            self.pitch += max(-most, min(most, self._wanted - self.pitch))

    def attitude(self, vehicle: Quaternion) -> Quaternion:
        """Return the camera's attitude on a vehicle with the attitude ``vehicle`` (body to NED)."""
        if not self.on_gimbal:
            return product(vehicle, quaternion(0.0, self.pitch, 0.0))
        return quaternion(0.0, self.pitch, euler(vehicle)[2])

    def offset(self, vehicle: Quaternion) -> Vector:
        """Return the camera's place relative to the vehicle's (m, NED)."""
        return rotated(vehicle, self._config.at)
