"""Over real sockets, under the wall clock, while others do what they can: the pilot is heard, answered and
told where the vehicle is; it stays where it was, and nothing piles up."""

from __future__ import annotations

import gc
import os
import select
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from mavlink_bridge.clocks.clock import WallClock
from mavlink_bridge.key import Key
from mavlink_bridge.links.endpoints import TcpIn, UdpIn
from mavlink_bridge.links.tcp import BACKLOG, TcpListener
from mavlink_bridge.links.udp import MOST_PEERS, UdpListener
from mavlink_bridge.loops.lockstep import Scheduled
from mavlink_bridge.loops.realtime import RealTime
from mavlink_bridge.messages import CommandAck, CommandLong, LocalPosition, Source
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.signing import Signing
from tests.sitl.autopilot_rig import LINK, Rig
from tests.sitl.hostile import command

HOST = "127.0.0.1"
HERE = Path(__file__).parent
KEY = Key.of_passphrase("correct horse")
ME = Source(255, 190)
PERIOD = 5_000
PATIENCE, AGAIN = 60.0, 1.0
"""s until an answer, which takes some milliseconds as a rule; and until the question is repeated."""
BLOCKS = 20_000
"""Of Python's memory, by which it may grow: what the queues may hold, and not what comes in a second."""


class Pilot:
    """One client over TCP, who asks, and hears what is told to all."""

    def __init__(self, port: int, signing: Signing | None) -> None:
        self._socket = socket.create_connection((HOST, port))
        self._signing = signing
        self._codec = Codec(lambda message_id, _system, _component: message_id in (32, 77), signing)
        self.positions: list[LocalPosition] = []
        self.answers = 0
        # ArduPilot streams nothing unasked on a new link.
        self._say(command(511, 32, 100_000, source=ME))

    def ask(self) -> None:
        """Ask, and wait for an answer; after a while ask again, as any client does."""
        wanted, began, asked = self.answers + 1, time.monotonic(), -AGAIN
        while self.answers < wanted:
            now = time.monotonic()
            assert now - began < PATIENCE, "no answer came"
            if now - asked >= AGAIN:
                asked = now
                self._say(command(520, source=ME))
            self.listen()

    def hear(self, count: int) -> None:
        """Listen until ``count`` positions have come."""
        began = time.monotonic()
        while len(self.positions) < count:
            assert time.monotonic() - began < PATIENCE, "no position came"
            self.listen()

    def _say(self, message: CommandLong) -> None:
        if self._signing is not None:
            self._signing.present(time.time_ns() // 1000)
        self._socket.sendall(self._codec.encode(message))

    def listen(self) -> None:
        """To what comes next."""
        ready, _, _ = select.select([self._socket], [], [], PATIENCE)
        assert ready, "nothing came"
        for message in self._codec.feed(self._socket.recv(1 << 16)):
            if isinstance(message, LocalPosition):
                self.positions.append(message)
            elif isinstance(message, CommandAck):
                self.answers += (message.target_system, message.target_component) == ME

    def leave(self) -> None:
        self._socket.close()


@contextmanager
def flying(rig: Rig, udp: UdpListener, tcp: TcpListener) -> Iterator[RealTime]:
    """The vehicle under the wall clock, in a thread."""
    loop = RealTime(Scheduled(rig.autopilot, PERIOD, 0), {LINK: [udp, tcp]}, WallClock())
    stop = threading.Event()
    thread = threading.Thread(target=loop.run, args=(stop.is_set,))
    thread.start()
    try:
        yield loop
    finally:
        stop.set()
        thread.join()


@contextmanager
def flooded(udp: UdpListener, tcp: TcpListener) -> Iterator[None]:
    """Another process in everybody's way."""
    paths = os.pathsep.join(
        (str(HERE), str(HERE.parent / "mavlink_bridge"), os.environ.get("PYTHONPATH", ""))
    )
    ports = (str(link.address[1]) for link in (udp, tcp))
    process = subprocess.Popen(
        [sys.executable, str(HERE / "flooder.py"), *ports], env={**os.environ, "PYTHONPATH": paths}
    )
    try:
        while udp.counters.received < 1_000:
            assert process.poll() is None
            time.sleep(0.01)
        yield
        assert process.poll() is None
    finally:
        process.kill()
        process.wait()


def blocks() -> int:
    """Of Python's memory, in use."""
    gc.collect()
    return sys.getallocatedblocks()


@pytest.mark.slow
@pytest.mark.parametrize("key", [None, KEY])
def test_a_pilot_is_served_whatever_others_do(key: Key | None) -> None:
    Rig(start_height=20.0).run(0.1)  # so that all is compiled
    clock = WallClock()
    mine = Signing(key) if key else None
    epoch = time.time_ns() // 1000
    rig = Rig(start_height=20.0, streams="normal", signing=Signing(key) if key else None, epoch=epoch)
    udp, tcp = UdpListener(UdpIn(HOST, 0), clock), TcpListener(TcpIn(HOST, 0), clock)
    with flying(rig, udp, tcp) as loop:
        pilot = Pilot(tcp.address[1], mine)
        pilot.hear(1)
        before = len(pilot.positions)
        with flooded(udp, tcp):
            for _ in range(25):
                pilot.ask()
            used = blocks()
            for _ in range(50):
                pilot.ask()
            pilot.hear(before + 12)
            grown = blocks() - used
            waiting = [len(stream._waiting) for stream in tcp._streams]
            assert len(udp._peers) <= MOST_PEERS
        # All that left are forgotten, and the pilot is still there.
        while tcp.peers > 1:
            pilot.ask()
        pilot.ask()
    pilot.leave()
    assert grown < BLOCKS
    assert max(waiting) <= BACKLOG
    assert loop.statistics.unrouted == 0
    np.testing.assert_allclose(rig.autopilot.state.position, [0.0, 0.0, -20.0], atol=0.02)
    assert rig.autopilot.armed
    if mine is not None:
        assert len(rig.autopilot._endpoint.signing._streams) == 1  # type: ignore[union-attr]
