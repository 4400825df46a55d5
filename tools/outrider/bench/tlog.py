"""Speed of reading a tlog, compared with pymavlink's reader on the same log."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import Attitude, GlobalPosition, Heartbeat, LocalPosition, Message, Source
from mavlink_bridge.tlog.log import TlogWriter, read_tlog
from mavlink_bridge.wire.codec import Codec
from outrider.logs.tally import count

_FRAMES = 20_000
_SOURCE = Source(11, mavlink.MAV_COMP_ID_AUTOPILOT1)


def reading(rounds: int) -> dict[str, float]:
    """Return messages per CPU-second on one core, medians over interleaved rounds.

    Measured are the reader (framing only), the census of ``replay --list``, and pymavlink's mavlogfile, which
    also decodes every message; ``tlog_times_pymavlink`` is the ratio of the reader's rate to mavlogfile's.
    Raises RuntimeError if a reader does not return all messages.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bench.tlog"
        _write(path)
        ways: dict[str, Callable[[], int]] = {
            "tlog_messages_per_s": lambda: sum(1 for _ in read_tlog(path)),
            "tlog_census_messages_per_s": lambda: _census(path),
            "tlog_messages_per_s_pymavlink": lambda: _by_pymavlink(path),
        }
        rates: dict[str, list[float]] = {name: [] for name in ways}
        for _ in range(rounds):
            for name, read in ways.items():
                started = time.process_time()
                if read() != _FRAMES:
                    raise RuntimeError("a reader did not return all messages of the benchmark's log")
                rates[name].append(_FRAMES / (time.process_time() - started))
    figures = {name: round(float(np.median(values))) for name, values in rates.items()}
    ours, theirs = (np.array(rates[f"tlog_messages_per_s{of}"]) for of in ("", "_pymavlink"))
    return {**figures, "tlog_times_pymavlink": round(float(np.median(ours / theirs)), 1)}


def _census(path: Path) -> int:
    census = count(path, lambda _share: None)
    return 0 if census is None else census.report.good


def _by_pymavlink(path: Path) -> int:
    # Without this setting pymavlink begins with MAVLink 1.
    os.environ["MAVLINK20"] = "1"
    from pymavlink import mavutil

    log = mavutil.mavlogfile(str(path))
    try:
        messages = 0
        while log.recv_msg() is not None:
            messages += 1
    finally:
        log.close()
    return messages


def _write(path: Path) -> None:
    """Write telemetry as an autopilot sends it: short messages and longer ones."""
    codec = Codec()
    with TlogWriter(path) as log:
        for number in range(_FRAMES):
            log.write(1000 * number, 0, codec.encode(_message(number)))


def _message(number: int) -> Message:
    now = 1000 * number
    position, velocity = (1.0, 2.0, -5.0), (1.0, 2.0, 0.5)
    if number % 100 == 0:
        kind, autopilot = mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
        return Heartbeat(_SOURCE, kind, autopilot, 81, mavlink.COPTER_MODE_GUIDED, mavlink.MAV_STATE_ACTIVE)
    if number % 3 == 0:
        return GlobalPosition(_SOURCE, now, 47.0, 8.0, 500.0, 5.0, velocity, None)
    if number % 3 == 1:
        return Attitude(_SOURCE, now, 0.1, -0.2, 3.0, (0.0, 0.1, 0.2))
    return LocalPosition(_SOURCE, now, position, velocity)
