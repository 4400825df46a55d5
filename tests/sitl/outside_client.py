"""A ground station that knows nothing of ours: it speaks and reads with pymavlink alone."""

from __future__ import annotations

from typing import Any

from pymavlink.dialects.v20 import all as dialect

from tests.sitl.autopilot_rig import Rig

ME = (255, 190)


class Client:
    """Talks to the autopilot of ``rig`` in bytes that pymavlink makes, and reads its answers with it."""

    def __init__(self, rig: Rig, source: tuple[int, int] = ME, *, v1: bool = False) -> None:
        self.rig = rig
        self.peer = dialect.MAVLink(None, srcSystem=source[0], srcComponent=source[1])
        self._v1 = v1
        self._read = len(rig.bytes)
        self.received: list[Any] = []

    def send(self, *messages: Any) -> list[Any]:
        """What comes back in the step in which ``messages`` arrive."""
        return self._step(b"".join(m.pack(self.peer, force_mavlink1=self._v1) for m in messages))

    def wait(self, seconds: float) -> list[Any]:
        """What comes in so much time."""
        first = len(self.received)
        for _ in range(round(seconds * 1e6 / self.rig.tick)):
            self._step(b"")
        return self.received[first:]

    def of(self, name: str) -> list[Any]:
        """All that came of one type."""
        return [m for m in self.received if m.get_type() == name]

    def command(self, command: int, *params: float) -> int:
        """The result of a COMMAND_LONG."""
        values = (*map(float, params), *([0.0] * 7))[:7]
        found = self.send(dialect.MAVLink_command_long_message(11, 1, command, 0, *values))
        (ack,) = [m for m in found if m.get_type() == "COMMAND_ACK" and m.command == command]
        assert (ack.target_system, ack.target_component) == (self.peer.srcSystem, self.peer.srcComponent)
        return int(ack.result)

    @property
    def texts(self) -> list[str]:
        """STATUSTEXT."""
        return [m.text for m in self.of("STATUSTEXT")]

    def _step(self, data: bytes) -> list[Any]:
        self.rig.step_bytes(data)
        new = self.rig.bytes[self._read :]
        self._read = len(self.rig.bytes)
        found = self.peer.parse_buffer(bytearray(new)) or [] if new else []
        assert all(m.get_type() != "BAD_DATA" for m in found)
        self.received += found
        return found


def only(found: list[Any], name: str) -> Any:
    """The one message of a type."""
    (message,) = [m for m in found if m.get_type() == name]
    return message
