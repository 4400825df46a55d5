"""A process that is in everybody's way: ``python flooder.py UDP_PORT TCP_PORT``, until it is ended.

All at once: 10 000 valid messages a second over UDP; over TCP one that asks and never reads, one that sends
the worst of garbage as fast as it is taken, and callers that leave in the middle of a frame.
"""

from __future__ import annotations

import contextlib
import socket
import struct
import sys
import time
from itertools import cycle

from tests.sitl.hostile import RATE, crowd, garbage

HOST = "127.0.0.1"
_TURN = 0.02


def leave(port: int, data: bytes, *, rudely: bool) -> None:
    """Call, say a part of something, and be gone; ``rudely``: without a farewell."""
    with socket.create_connection((HOST, port)) as caller:
        if rudely:
            caller.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        caller.send(data)


def main(udp: int, tcp: int) -> None:
    valid = crowd()
    with contextlib.ExitStack() as stack:
        talker = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        talker.connect((HOST, udp))
        deaf, noisy = (stack.enter_context(socket.create_connection((HOST, tcp))) for _ in range(2))
        says = {deaf: b"".join(crowd(500, ("pings",))), noisy: b"\xfe" * 60_000 + b"".join(garbage(1))}
        for one in says:
            one.setblocking(False)
        pieces, due, turn = cycle(valid), time.monotonic(), 0
        while True:
            for _ in range(round(RATE * _TURN)):
                with contextlib.suppress(ConnectionError):
                    talker.send(next(pieces))
            for one, data in says.items():
                # Given up for never reading, it is gone for good.
                with contextlib.suppress(BlockingIOError, ConnectionError):
                    one.send(data)
            if turn % 5 == 0:
                with contextlib.suppress(ConnectionError):
                    leave(tcp, valid[turn % len(valid)][:-4], rudely=turn % 2 == 0)
            turn += 1
            due += _TURN
            time.sleep(max(due - time.monotonic(), 0.0))


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
