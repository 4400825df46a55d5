"""A vehicle of ``outrider sitl`` in a process of its own, and the same client beyond a socket: TCP or UDP.

The vehicle's own time, in its messages, is the clock of the client: a busy machine makes a flight longer and
no assertion false.
"""

from __future__ import annotations

import socket
from typing import Any, Final

from pymavlink.dialects.v20 import all as dialect

from tests.clients.conformance.stand import INTERVAL, Stand
from tests.clients.sitl_process import PATIENCE, Sitl
from tests.sitl.autopilot_rig import SITE
from tests.sitl.outside_client import ME

OPTIONS: Final = ("--first-id=11", f"--origin={SITE.latitude},{SITE.longitude},{SITE.altitude}")
"""The vehicle of the simulated clock."""
_NEXT: Final = ("MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_ACK")
_ANSWERS: Final = {
    "COMMAND_LONG": ("COMMAND_ACK",),
    "COMMAND_INT": ("COMMAND_ACK",),
    "MISSION_COUNT": _NEXT,
    "MISSION_ITEM_INT": _NEXT,
    "MISSION_REQUEST_LIST": ("MISSION_COUNT",),
    "MISSION_REQUEST_INT": ("MISSION_ITEM_INT",),
    "PARAM_REQUEST_READ": ("PARAM_VALUE",),
    "PARAM_SET": ("PARAM_VALUE",),
}
"""What comes for a message: the network and the other process take their time."""
_ANSWERED_US: Final = 3_000_000


class SocketRig:
    """What ``Client`` needs of a rig. ``now`` (µs) is the time since boot of the vehicle's last message."""

    def __init__(self, sitl: Sitl) -> None:
        self.flavour, self.tick, self.now, self.bytes = sitl.flavour, 10_000, 0, b""
        self._until = 0
        self._reader = dialect.MAVLink(None)
        if sitl.flavour == "ardupilot":
            self._socket = socket.create_connection(("127.0.0.1", sitl.base), PATIENCE)
        else:
            self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            self._socket.bind(("127.0.0.1", sitl.base))
            self._socket.settimeout(PATIENCE)
            _, vehicle = self._socket.recvfrom(65_536)
            self._socket.connect(vehicle)

    def step_bytes(self, data: bytes) -> None:
        """Send ``data`` and read until the vehicle is a tick older, or once while its time is not known."""
        if data:
            self._socket.send(data)
        self._until = max(self._until + self.tick, self.now)
        reads = bool(data) or not self.now
        while reads or 0 < self.now < self._until:
            new = self._socket.recv(65_536)
            if not new:
                raise ConnectionError("the vehicle has closed the connection")
            self.bytes += new
            for message in self._reader.parse_buffer(bytearray(new)) or []:
                self.now = max(self.now, 1000 * getattr(message, "time_boot_ms", 0))
            reads = False

    def close(self) -> None:
        self._socket.close()


class SocketStand(Stand):
    """The client of ``Stand``; it waits for answers, and for the vehicle's time."""

    def __init__(self, sitl: Sitl) -> None:
        super(Stand, self).__init__(SocketRig(sitl), ME)
        # ArduPilot streams nothing before it is asked, so these orders bring its time.
        for message_id in (30, 32, 33, 74):
            self.command(INTERVAL, message_id, 20_000 if message_id == 32 else 100_000)
        self.wait(1.5)

    def send(self, *messages: Any) -> list[Any]:
        """What comes until each message is answered that asks for it; an answer may fail to come."""
        first, since = len(self.received), self.rig.now
        super().send(*messages)
        for message in messages:
            kinds = _ANSWERS.get(message.get_type())
            while kinds and not any(m.get_type() in kinds for m in self.received[first:]):
                if self.rig.now - since > _ANSWERED_US:
                    break
                self._step(b"")
        return self.received[first:]
