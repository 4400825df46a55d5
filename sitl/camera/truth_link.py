"""Link ``sight`` of one vehicle: truth about others for its camera, and about it for others' cameras."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt
from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.frames import FleetFrame, ned_to_enu
from mavlink_bridge.messages import HilState, Source
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec
from sitl.camera.camera import Camera
from sitl.camera.scene import LINK, truth

_TRUTH: Final[int] = mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION
_PERIOD_US: Final = 50_000


class TruthLink:
    """Receiver of the truth for ``camera``, and sender of that about the vehicle if it ``shows`` itself."""

    def __init__(self, source: Source, site: FleetFrame, camera: Camera | None, *, shows: bool) -> None:
        self._source, self._site, self._camera = source, site, camera
        self._shows, self._next = shows, 0
        self._codec = Codec(lambda message_id, _system, _component: message_id == _TRUTH)

    def receive(self, data: bytes) -> None:
        """Pass the places of others in a datagram on to the camera, if there is one."""
        if self._camera is None:
            return
        for sight in self._codec.feed(data, whole=True):
            if isinstance(sight, HilState):
                self._camera.receive(sight)

    def due(self, now: int) -> bool:
        """Return whether the truth about this vehicle is due at ``now`` (µs since boot)."""
        return self._shows and now >= self._next

    def show(self, now: int, time: int, position: npt.NDArray[np.float64]) -> Datagram:
        """Return the ``position`` (3,) (m, site NED) at ``time`` (µs, as in ``truth``), sent at ``now``."""
        self._next = now + _PERIOD_US
        said = truth(self._source, time, ned_to_enu(position), self._site)
        return Datagram(LINK, self._codec.encode(said))
