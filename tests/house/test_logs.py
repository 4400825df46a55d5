"""The recorded target is what config/logs/README.md says it is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega

from mavlink_bridge.tlog.log import Record, read_tlog

LOG = Path(__file__).parents[2] / "config" / "logs" / "escort-target.tlog"


def decoded() -> tuple[list[Record], np.ndarray]:
    """The records, and (n, 9) their fields: boot time s, latitude and longitude °, altitude and height m,
    velocity m/s (3), heading °."""
    parser = ardupilotmega.MAVLink(None)
    records = list(read_tlog(LOG))
    messages = [parser.decode(bytearray(record.frame)) for record in records]
    assert {message.get_type() for message in messages} == {"GLOBAL_POSITION_INT"}
    names = ("time_boot_ms", "lat", "lon", "alt", "relative_alt", "vx", "vy", "vz", "hdg")
    scales = np.array([1e3, 1e7, 1e7, 1e3, 1e3, 1e2, 1e2, 1e2, 1e2])
    return records, np.array([[getattr(message, name) for name in names] for message in messages]) / scales


RECORDS, FIELDS = decoded()
TIME = np.array([record.time - RECORDS[0].time for record in RECORDS]) / 1e6
ESCORT = (TIME >= 5.0) & (TIME < 65.0)


def test_nothing_else_is_in_it() -> None:
    log = read_tlog(LOG)
    assert list(log) == RECORDS
    report = log.report
    assert (report.bad, report.skipped_bytes, report.time_steps_back, report.truncated) == (0, 0, 0, False)
    assert len(RECORDS) == 201
    assert {(record.link, record.frame[0], record.frame[3], record.frame[4]) for record in RECORDS} == {
        (0, 0xFE, 1, 1)
    }


@pytest.mark.parametrize(
    ("part", "count", "rate", "lowest", "first"),
    [
        (np.full(len(TIME), True), 201, 2.87, 1.34, (-35.3623073, 149.1656991, 592.09, 1.35)),
        (ESCORT, 171, 2.86, 2.81, (-35.3622913, 149.1656747, 593.55, 2.81)),
    ],
)
def test_the_figures_hold(
    part: np.ndarray, count: int, rate: float, lowest: float, first: tuple[float, ...]
) -> None:
    time, fields = TIME[part], FIELDS[part]
    speed = np.hypot(fields[:, 5], fields[:, 6])
    assert len(time) == count
    assert (count - 1) / (time[-1] - time[0]) == pytest.approx(rate, abs=0.005)
    assert np.diff(time).max() == pytest.approx(0.67, abs=0.005)
    assert np.diff(fields[:, 0]).max() == pytest.approx(0.61, abs=0.005)
    assert (speed.mean(), speed.max()) == pytest.approx((1.80, 5.02), abs=0.006)
    assert (fields[:, 7].min(), fields[:, 7].max()) == pytest.approx((-1.85, 1.42))
    assert (fields[:, 4].min(), fields[:, 4].max()) == pytest.approx((lowest, 10.77))
    assert tuple(fields[0, 1:5]) == pytest.approx(first, abs=1e-9)


def test_its_vertical_speed_is_positive_up() -> None:
    boot, height, vz = FIELDS[:, 0], FIELDS[:, 4], FIELDS[:, 7]
    path = np.concatenate([[0.0], np.cumsum(np.diff(boot) * (vz[1:] + vz[:-1]) / 2.0)])
    climbed, integrated = height[3:] - height[:-3], path[3:] - path[:-3]
    assert (integrated @ climbed) / (integrated @ integrated) == pytest.approx(1.03, abs=0.01)
    assert np.corrcoef(integrated, climbed)[0, 1] > 0.94
