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
"""s of the line's capacity that may wait to be sent; more is refused.

The system alone would queue 4 KiB, 0.7 s of 57 600 baud: too old for set-points.
"""
_BITS: Final = 10  # bits of a byte on the line, with start and stop bit


class SerialPort(StreamLink):
    """Link of ``/dev/…,BAUD``.

    A port that vanishes (a cable pulled out) is opened again when it is back. Raises LinkError if it is
    missing at first, is in use by another process, or is no serial port.
    """

    def __init__(self, endpoint: Serial, clock: Clock) -> None:
        if sys.platform == "win32":
            raise LinkError(f"{endpoint}: serial ports need a POSIX system; use udpin: or tcp: here")
        self._endpoint = endpoint
        self._most = max(int(QUEUE * endpoint.baud / _BITS), 1)
        self._speed = getattr(termios, f"B{endpoint.baud}", None)
        if self._speed is None:
            raise LinkError(f"{endpoint}: this system knows no {endpoint.baud} baud")
        first = self._raw()
        super().__init__(clock, self._most)
        self._adopt(first)

    def send(self, data: bytes) -> None:
        """Write ``data`` if the line will transmit it soon; drop it otherwise."""
        if self._queued() > self._most:
            with self._lock:
                self._dropped += 1
            return
        super().send(data)

    def let_go(self) -> None:
        """Leave the port to a process that was forked with it.

        The next call of receive or send here opens the port again. The copy must be closed: a port that was
        pulled out comes back under another name while any process has it open.
        """
        with self._lock:
            self._forget()
            self._next_attempt = self._clock.now()

    def _reopen(self, now: int) -> None:
        try:
            self._adopt(self._raw())
        except LinkError:
            return

    def _raw(self) -> int:
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
            # VMIN may be 0 from an earlier user: then an idle port would look like one that is gone.
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
