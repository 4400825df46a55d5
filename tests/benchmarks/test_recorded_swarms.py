"""Recorded swarms: what is cut out of logs is what was flown, and files that hold none are refused."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.extract_swarm import extracted, main, measured_at
from benchmarks.recorded_swarms import SwarmVehicle, at_times, read_swarm, write_swarm
from mavlink_bridge.frames import FleetFrame, ned_to_enu
from mavlink_bridge.messages import GpsGlobalOrigin, Heartbeat, LocalPosition, SetpointLocal, Source
from mavlink_bridge.tlog.log import TlogWriter
from mavlink_bridge.wire.codec import Codec
from outrider.errors import InputError

ORIGIN = FleetFrame(47.397742, 8.545594, 488.0)
AWAY = (5.0, -3.0, -0.5)
"""m, NED: where the vehicle's own local frame begins in the fleet's."""
BEGIN = 1_795_000_000.0
VELOCITY = np.array((1.0, -2.0, 0.5))


def vehicle(system: int = 3) -> SwarmVehicle:
    numbers = np.arange(40.0)
    return SwarmVehicle(
        system,
        "px4",
        np.column_stack([numbers + k for k in range(10)]),
        np.column_stack([numbers / 4.0 + k for k in range(7)]),
        np.column_stack([numbers / 8.0 - k for k in range(7)]),
    )


def at(local: object) -> tuple[float, float, float]:
    x, y, z = np.asarray(local, dtype=np.float64).tolist()
    return x, y, z


def recorded(folder: Path, seconds: float = 8.0) -> None:
    """An ArduCopter at constant velocity whose messages come up to 30 ms late; every tenth does not."""
    latitude, longitude, altitude = ORIGIN.to_geodetic(ned_to_enu(AWAY))
    own, companion = Source(7, 1), Source(7, 191)
    (folder / "configuration-7.yaml").write_text(
        yaml.safe_dump({"origin": {"latitude": 47.397742, "longitude": 8.545594, "altitude": 488.0}})
    )
    codec = Codec()
    with TlogWriter(folder / "vehicle-7.tlog.gz") as log:
        messages = [
            (2.0, Heartbeat(own, 2, 3, 81, 4, 3)),
            (2.1, GpsGlobalOrigin(own, latitude, longitude, altitude, 0)),
        ]
        for k in range(round(seconds * 50.0)):
            time = 3.0 + 0.02 * k
            late = 0.003 * (k % 10)
            place = at(VELOCITY * time)
            messages += [
                (time + late, LocalPosition(own, round((time + 100.0) * 1e6), place, at(VELOCITY))),
                (
                    time + 0.01,
                    SetpointLocal(companion, 0, 7, 1, 1, 0, place, at(VELOCITY), (0.5, 0.0, 0.0), 0.0, 0.0),
                ),
            ]
        for time, message in sorted(messages, key=lambda row: row[0]):
            log.write(round((BEGIN + time) * 1e6), 0, codec.encode(message))
    times = np.arange(0.0, 15.0, 0.05)
    places = ned_to_enu(np.outer(times, VELOCITY) + AWAY)
    rows = np.column_stack((times + BEGIN, places, np.tile(ned_to_enu(VELOCITY), (len(times), 1))))
    # The recorder wrote some rows twice.
    np.savez(folder / "truth.npz", T0=BEGIN, t7=np.repeat(rows, 2, axis=0), e7=rows, tgt=rows)


def test_what_is_written_is_read_again(tmp_path: Path) -> None:
    write_swarm(tmp_path / "swarm.npz", [vehicle(3), vehicle(11)])
    there = read_swarm(tmp_path / "swarm.npz")
    assert [one.system for one in there] == [3, 11]
    for one in there:
        for mine, theirs in zip(one[2:], vehicle()[2:], strict=True):
            np.testing.assert_array_equal(mine, theirs)


def test_the_same_swarm_gives_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write_swarm(tmp_path / name, [vehicle()])
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_an_extract_has_all_in_the_fleets_frame_at_the_times_of_its_making(tmp_path: Path) -> None:
    recorded(tmp_path)
    (one,) = extracted(tmp_path)
    assert (one.system, one.flavour) == (7, "ardupilot")
    assert len(one.setpoints) == 400
    for rows, tolerance in ((one.setpoints, 0.03), (one.estimate, 5e-3), (one.truth, 1e-3)):
        assert np.all(np.diff(rows[:, 0]) > 0.0)
        expected = np.outer(rows[:, 0], VELOCITY) + AWAY
        # A set-point is stamped 10 ms after the place that it names.
        np.testing.assert_allclose(rows[:, 1:4], expected, atol=tolerance)
        np.testing.assert_allclose(rows[:, 4:7], np.tile(VELOCITY, (len(rows), 1)), atol=1e-3)
    np.testing.assert_allclose(one.setpoints[:, 7:], np.tile((0.5, 0.0, 0.0), (400, 1)), atol=1e-3)
    moments = np.arange(4.0, 10.0, 0.1)
    np.testing.assert_allclose(at_times(one.estimate, moments), at_times(one.truth, moments), atol=6e-3)


def test_the_command_writes_what_can_be_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    recorded(tmp_path, seconds=3.0)
    monkeypatch.setattr(sys, "argv", ["extract_swarm.py", str(tmp_path), str(tmp_path / "out.npz")])
    assert main() == 0
    assert "out.npz" in capsys.readouterr().out
    assert len(read_swarm(tmp_path / "out.npz")) == 1


@pytest.mark.parametrize(
    "missing", ["configuration-7.yaml", "vehicle-7.tlog.gz", "truth.npz"], ids=lambda name: name.split(".")[0]
)
def test_a_folder_without_a_part_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, missing: str
) -> None:
    recorded(tmp_path, seconds=1.0)
    (tmp_path / missing).unlink()
    monkeypatch.setattr(sys, "argv", ["extract_swarm.py", str(tmp_path), str(tmp_path / "out.npz")])
    assert main() == 2
    assert missing.partition("-")[0] in capsys.readouterr().err
    assert not (tmp_path / "out.npz").exists()


@given(st.lists(st.floats(0.0, 0.4), min_size=4, max_size=300), st.floats(-1e3, 1e3))
def test_the_least_delayed_message_tells_when_all_were_made(delays: list[float], offset: float) -> None:
    boot = np.arange(len(delays)) * 0.02
    late = np.array(delays)
    late[::40] = 0.0
    found = measured_at(boot + offset + late, boot)
    np.testing.assert_allclose(found, boot + offset, atol=1e-9)


@pytest.mark.parametrize(
    "what", ["nothing", "garbage", "truncated", "other arrays", "wrong shape", "no autopilot"]
)
def test_what_holds_no_swarm_is_refused(tmp_path: Path, what: str) -> None:
    path = tmp_path / "swarm.npz"
    write_swarm(path, [vehicle()])
    whole = path.read_bytes()
    match what:
        case "nothing":
            path.unlink()
        case "garbage":
            path.write_bytes(b"garbage" * 100)
        case "truncated":
            path.write_bytes(whole[: len(whole) // 2])
        case "other arrays":
            np.savez(path, positions=np.zeros((3, 3)))
        case "wrong shape":
            write_swarm(path, [vehicle()._replace(truth=np.zeros((40, 6)))])
        case "no autopilot":
            write_swarm(path, [vehicle()._replace(flavour="plane")])  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"swarm\.npz"):
        read_swarm(path)
