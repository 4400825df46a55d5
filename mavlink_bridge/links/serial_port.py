"""Link over a serial port, with nothing but POSIX: raw bytes, 8N1, no flow control."""

from __future__ import annotations

import os
import sys
from array import array
from typing import Final

from mavlink_bridge.clocks.clock import Clock
from mavlink_bridge.errors import LinkError
from mavlink_bridge.links.endpoints import Serial
from mavlink_bridge.links.hosts import because
from mavlink_bridge.links.streams import StreamLink

if sys.platform != "win32":
    import fcntl
    import termios

QUEUE: Final = 0.25
"""Largest send queue, in s of the line's capacity; while it is longer, datagrams are dropped.

The system would queue 4 KiB, 0.7 s at 57 600 baud, which is too late for set-points.
"""
_BITS_PER_BYTE: Final = 10  # with start and stop bit


class SerialPort(StreamLink):
    """Link of ``/dev/…,BAUD``.

    A port that vanishes (a cable pulled out) is opened again when it is back. Raises LinkError if it is
    missing at first, in use by another process, or no serial port, or if the system lacks its baud rate.
    """

    def __init__(self, endpoint: Serial, clock: Clock) -> None:
        if sys.platform == "win32":
            raise LinkError(f"{endpoint}: serial ports need a POSIX system; use udpin: or tcp: here")
        self._endpoint = endpoint
        self._max_queued = max(int(QUEUE * endpoint.baud / _BITS_PER_BYTE), 1)
        self._speed = getattr(termios, f"B{endpoint.baud}", None)
        if self._speed is None:
            raise LinkError(f"{endpoint}: this system knows no {endpoint.baud} baud")
        first = self._open_port()
        super().__init__(clock, self._max_queued)
        self._adopt(first)

    def send(self, data: bytes) -> None:
        """Write ``data``, or drop it if more than ``QUEUE`` waits to be transmitted."""
        if self._queued() > self._max_queued:
            with self._lock:
                self._dropped += 1
            return
        super().send(data)

    def let_go(self) -> None:
        """Leave the port to a process that was forked with it.

        This process closes its descriptor: as long as any process has an unplugged port open, the port comes
        back under another name. The next call of receive or send in this process opens the port again.
        """
        with self._lock:
            self._forget()
            self._next_attempt = self._clock.now()

    def _reopen(self, now: int) -> None:
        try:
            self._adopt(self._open_port())
        except LinkError:
            return

    def _open_port(self) -> int:
        """Open the port for exclusive use, set it up, and return its file descriptor."""
        try:
            port = os.open(self._endpoint.device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        except OSError as error:
            raise LinkError(f"{self._endpoint}: cannot open the port: {because(error)}") from None
        try:
            fcntl.ioctl(port, termios.TIOCEXCL)
            _, _, control, _, _, _, characters = termios.tcgetattr(port)
            control &= ~(termios.CSIZE | termios.PARENB | termios.CSTOPB | getattr(termios, "CRTSCTS", 0))
            control |= termios.CS8 | termios.CREAD | termios.CLOCAL
            # With VMIN = 0, as an earlier user may have set it, an idle port would look like a removed one.
            characters[termios.VMIN], characters[termios.VTIME] = 1, 0
            speed = self._speed
            termios.tcsetattr(port, termios.TCSANOW, [0, 0, control, 0, speed, speed, characters])
        except (OSError, termios.error) as error:
            os.close(port)
            raise LinkError(f"{self._endpoint}: not a serial port: {error.args[-1]}") from None
        return port

    def _queued(self) -> int:
        """Return the number of bytes that the system still has to send."""
        with self._lock:
            if not self._streams:
                return 0
            count = array("i", [0])
            try:
                fcntl.ioctl(self._streams[0].fileno(), termios.TIOCOUTQ, count)
            except OSError:
                return 0
            return count[0]
