"""Traffic counter for datagrams of whole frames, which also collects their STATUSTEXTs."""

from __future__ import annotations

from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.wire.framing import STARTS, claimed_length

_TEXT: Final = 50
# Length of the payload's first fields: severity, 50 characters, id. The number of the piece follows.
_PIECE: Final = 53


class Traffic:
    """Counter of the frames of one vehicle, ``received`` and ``sent``.

    ``sayings`` are the texts that it has sent since the list was last cleared.
    """

    def __init__(self) -> None:
        self.received = 0
        self.sent = 0
        self.sayings: list[str] = []

    def receive(self, data: bytes) -> None:
        """Count what looks like frames in received ``data``, which may be anything."""
        at = 0
        while at < len(data):
            length = claimed_length(data, at)
            if length is None:
                start = STARTS.search(data, at + 1)
                at = len(data) if start is None else start.start()
            else:
                at += length
                self.received += 1

    def send(self, data: bytes) -> None:
        """Count the frames of outgoing ``data``, which holds version 2 frames, and collect texts."""
        at = 0
        while at < len(data):
            length = data[at + 1]
            if data[at + 7] == mavlink.MAVLINK_MSG_ID_STATUSTEXT and not data[at + 8] and not data[at + 9]:
                self._note(data[at + mavlink.HEADER_LEN_V2 : at + mavlink.HEADER_LEN_V2 + length])
            at += claimed_length(data, at) or len(data)
            self.sent += 1

    def _note(self, payload: bytes) -> None:
        text = payload[1 : 1 + _TEXT].rstrip(b"\0").decode("ascii", errors="replace")
        if len(payload) > _PIECE and payload[_PIECE] and self.sayings:
            self.sayings[-1] += text
        else:
            self.sayings.append(text)
