"""MAVLink endpoint of an autopilot: messages from bytes, and bytes from messages."""

from __future__ import annotations

from collections.abc import Container, Sequence

from mavlink_bridge.errors import EncodeError
from mavlink_bridge.messages import Message
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.packing import parcels
from mavlink_bridge.wire.signing import Signing


class Endpoint:
    """Codec that never stops the vehicle, with the ``signing`` of its messages, if any."""

    def __init__(self, received: Container[int], signing: Signing | None) -> None:
        """Set the ids of ``received`` messages; all others are dropped before they are decoded."""
        self.signing = signing
        self.not_encoded = 0
        """Number of messages that could not be encoded."""
        self._codec = Codec(lambda message_id, _system, _component: message_id in received, signing)

    def present(self, unix: int) -> None:
        """Set the time of signatures (µs, Unix time)."""
        if self.signing is not None:
            self.signing.present(unix)

    @property
    def signed_until(self) -> int:
        """Newest timestamp of a signed message (10 µs since the start of 2015), 0 without signing."""
        return 0 if self.signing is None else self.signing.newest

    def read(self, datagram: bytes) -> list[Message]:
        """Return the messages of a datagram that are received here."""
        return self._codec.feed(datagram, whole=True)

    def write(self, messages: Sequence[Message], together: Sequence[Message]) -> list[bytes]:
        """Return the datagrams with ``messages`` and then ``together``, which stay in one of them."""
        if not messages and not together:
            return []
        pieces = [encoded for message in messages if (encoded := self._encoded(message))]
        if together:
            pieces.append(b"".join(map(self._encoded, together)))
        return parcels(pieces)

    def _encoded(self, message: Message) -> bytes:
        """Encode a message.

        Return empty bytes if a value does not fit, because such a message must not stop the vehicle.
        """
        try:
            return self._codec.encode(message)
        except EncodeError:
            self.not_encoded += 1
            return b""
