"""Start of ``outrider fly``: CPU time and memory until the companion sends its first request.

The benchmark plays the autopilot: it sends heartbeats from a UDP socket and waits for the first message other
than a heartbeat, which only the flying process sends. The supervising and the flying process are measured
together.
"""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final, NamedTuple

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import Heartbeat, Source
from mavlink_bridge.wire.codec import Codec

_SYSTEM: Final = 1
_BEAT: Final = Heartbeat(
    Source(_SYSTEM, mavlink.MAV_COMP_ID_AUTOPILOT1),
    mavlink.MAV_TYPE_QUADROTOR,
    mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
    0,
    0,
    mavlink.MAV_STATE_STANDBY,
)
_PERIOD_S: Final = 0.05
_LIMIT_S: Final = 120.0
_MIB: Final = 1024.0
"""KiB of a MiB."""


_ROUNDS: Final = 3


def fastest() -> dict[str, float]:
    """Return the figures of the start that took the least CPU time; the first may fill caches."""
    return min((measured() for _ in range(_ROUNDS)), key=lambda figures: figures.get("cpu_s", 0.0))


def measured() -> dict[str, float]:
    """Start the command once and return its figures; empty where the system has no /proc.

    ``cpu_s``: CPU time of all processes (s). ``memory_mib``: their resident memory; pages that they share
    count once, that is the anonymous pages of all (Pss_Anon) and the pages of files of the process that has
    most of them. ``anonymous_mib``: of it the anonymous pages; how many pages of files are resident depends
    on what the kernel had read before. ``largest_mib``: resident memory (Rss) of the larger process.
    """
    if not Path("/proc/self/smaps_rollup").exists():
        return {}
    with tempfile.TemporaryDirectory() as folder, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as own:
        own.bind(("127.0.0.1", 0))
        own.settimeout(_PERIOD_S)
        with _command(own.getsockname()[1], Path(folder)) as process:
            _await_request(own, process)
            family = [process.pid, *_children(process.pid)]
            ticks = sum(_ticks(pid) for pid in family)
            memory = [_memory(pid) for pid in family]
    anonymous = sum(one.own for one in memory)
    return {
        "cpu_s": ticks / os.sysconf("SC_CLK_TCK"),
        "anonymous_mib": round(anonymous, 1),
        "memory_mib": round(anonymous + max(one.files for one in memory), 1),
        "largest_mib": round(max(one.resident for one in memory), 1),
    }


@contextmanager
def _command(port: int, folder: Path) -> Iterator[subprocess.Popen[bytes]]:
    """Run the command on an autopilot at a UDP port of this machine; end it afterwards."""
    command = [sys.executable, "-m", "outrider", "fly", "--config", "ardupilot", "--system", str(_SYSTEM)]
    links = ["--autopilot", f"udpout:127.0.0.1:{port}", "--swarm", f"udpout:127.0.0.1:{port}"]
    with subprocess.Popen(
        [*command, *links, "--out", str(folder / "run")], stdin=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    ) as process:
        try:
            yield process
        finally:
            process.send_signal(signal.SIGINT)
            try:
                process.wait(20.0)
            except subprocess.TimeoutExpired:
                process.kill()


def _await_request(own: socket.socket, process: subprocess.Popen[bytes]) -> None:
    """Answer every datagram with a heartbeat until another message than a heartbeat arrives.

    Raises TimeoutError if none arrives, or if the command ends.
    """
    codec, until = Codec(), time.monotonic() + _LIMIT_S
    while time.monotonic() < until and process.poll() is None:
        try:
            data, sender = own.recvfrom(65535)
        except TimeoutError:
            continue
        if any(not isinstance(message, Heartbeat) for message in codec.feed(data)):
            return
        own.sendto(codec.encode(_BEAT), sender)
    raise TimeoutError(f"outrider fly sent no request within {_LIMIT_S:g} s, or ended")


def _children(pid: int) -> list[int]:
    return [int(word) for word in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def _ticks(pid: int) -> int:
    """Return the CPU time of a process, user and system, in ticks."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return int(fields[11]) + int(fields[12])


class _Memory(NamedTuple):
    """Resident memory of a process (MiB): its share of anonymous pages, its pages of files, and all pages."""

    own: float
    files: float
    resident: float


def _memory(pid: int) -> _Memory:
    lines = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()[1:]
    sizes = {name: int(value.split()[0]) / _MIB for name, _, value in (line.partition(":") for line in lines)}
    return _Memory(sizes["Pss_Anon"], sizes["Rss"] - sizes["Anonymous"], sizes["Rss"])
