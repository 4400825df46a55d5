"""Ground station: receives the companions' status texts."""

from __future__ import annotations

from collections.abc import Sequence

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.clocks.clock import WallClock
from mavlink_bridge.links.endpoints import UdpIn
from mavlink_bridge.links.link import Link
from mavlink_bridge.links.udp import UdpListener
from mavlink_bridge.messages import StatusText
from mavlink_bridge.wire.codec import Codec
from trials.plan import HOST


class Station:
    """Ground station; ``texts`` of each of ``systems``, in the order of arrival."""

    def __init__(self, systems: Sequence[int]) -> None:
        self.link, self.endpoint = listener()
        self.texts: dict[int, list[str]] = {system: [] for system in systems}
        self._codec = Codec(
            lambda identifier, system, _component: (
                identifier == mavlink.MAVLINK_MSG_ID_STATUSTEXT and system in self.texts
            )
        )

    def turn(self) -> None:
        """Process everything that has arrived."""
        for data in self.link.receive():
            for message in self._codec.feed(data, whole=True):
                if isinstance(message, StatusText):
                    self.texts[message.source.system].append(message.text)


def listener() -> tuple[Link, str]:
    """Open a UDP port; return it, and the endpoint for its senders."""
    link = UdpListener(UdpIn(HOST, 0), WallClock())
    return link, f"udpout:{HOST}:{link.address[1]}"
