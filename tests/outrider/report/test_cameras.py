"""What cameras saw is on the page: where they looked, and what they detected, while it was fresh."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import CameraFovStatus, CameraTrackingGeo, Source
from mavlink_bridge.tlog.log import TlogWriter, read_tlog
from mavlink_bridge.wire.codec import Codec
from outrider.report.command import make
from outrider.report.replay import Packed, unpack
from outrider.runs import names
from sitl.values.attitudes import quaternion
from tests.outrider.report.runs import BEFORE, BOOT, leave
from tests.outrider.report.test_data import embedded
from tests.outrider.shipped import scenario

CAMERA = Source(12, 100)
YAW, PITCH, ROLL = 0.4, -0.5, 0.1
DETECTED = (3.0, -4.0, 1.0)


def add_camera(log: Path, frame: FleetFrame) -> None:
    """Five images a second from 1 s to 4 s after the goal event; detections from 2 s to 3 s."""
    records = [(record.time, record.link, record.frame) for record in read_tlog(log)]
    codec, attitude = Codec(), quaternion(ROLL, PITCH, YAW)
    for n in range(15):
        now = BOOT + round(1e6 * (BEFORE + 1.0 + 0.2 * n))
        place = frame.to_geodetic((1.0, 2.0, 5.0))
        said = codec.encode(CameraFovStatus(CAMERA, now - BOOT, place, None, attitude, 1.2, 0.7))
        if 5 <= n < 10:
            said += codec.encode(CameraTrackingGeo(CAMERA, 1, *frame.to_geodetic(DETECTED), None))
        records.append((now, 0, said))
    records.sort(key=lambda record: record[0])
    with TlogWriter(log) as file:
        for time, link, data in records:
            file.write(time, link, data)


def test_a_page_has_where_cameras_looked_and_what_they_saw(tmp_path: Path) -> None:
    of = scenario("antipodal-8", vehicles=3)
    made = leave(tmp_path, vehicles=3, scenario=of)
    origin = of.origin
    frame = FleetFrame(origin.latitude, origin.longitude, origin.altitude)
    add_camera(made.directory / names.log(12), frame)
    document = embedded(make(made.directory).text)
    found: dict[str, dict[str, object]] = document["cameras"]  # type: ignore[assignment]
    time = unpack(Packed(**document["time"]))  # type: ignore[arg-type]
    axis, seen = (unpack(Packed(**found[name])).reshape(len(time), 3, 3) for name in ("axis", "seen"))  # type: ignore[arg-type]
    assert np.isnan(axis[:, [0, 2]]).all()
    assert np.isnan(seen[:, [0, 2]]).all()
    # The clocks of log and flight are laid over each other to some 20 ms.
    looks = (time > 1.05) & (time < 4.75)
    np.testing.assert_allclose(
        axis[looks, 1], np.tile((math.pi / 2 - YAW, PITCH, ROLL), (looks.sum(), 1)), atol=1e-3
    )
    assert np.isnan(axis[(time < 0.95) | (time > 4.9), 1]).all()
    detects = (time > 2.05) & (time < 2.95)
    np.testing.assert_allclose(seen[detects, 1], np.tile(DETECTED, (detects.sum(), 1)), atol=0.02)
    assert np.isnan(seen[(time < 1.95) | (time > 3.05), 1]).all()
    assert found["fields"] == [None, pytest.approx([1.2, 0.7], abs=1e-6), None]


def test_a_page_of_a_flight_without_cameras_has_none(tmp_path: Path) -> None:
    assert embedded(make(leave(tmp_path, vehicles=2).directory).text)["cameras"] is None
