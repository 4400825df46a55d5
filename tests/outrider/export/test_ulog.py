"""ULog: read back by pyulog, against pymavlink's reading of the same logs."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as mavlink
from pyulog import ULog
from pyulog.px4 import PX4ULog

from mavlink_bridge.tlog.log import TlogWriter
from mavlink_bridge.wire.framing import frame_v2
from outrider.export.command import export
from outrider.export.ulog_export import mavlink_topic
from outrider.logs.dialect import identifiers, kind
from tests.outrider.export.runs import SYSTEMS, Heard, everything, received, same

START = 1_700_000_000_000_000


@pytest.fixture(scope="module")
def folder(run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("out") / "ulog"
    export(run, "ulog", out, as_json=True)
    return out


def read(path: Path) -> ULog:
    found = ULog(str(path), disable_str_exceptions=False)
    assert not found.file_corruption
    return found


def zero(log: ULog) -> int:
    """Unix µs of its time 0."""
    return int(log.msg_info_dict["time_zero_unix_us"])


def write(path: Path, *messages: mavlink.MAVLink_message, who: tuple[int, int] = (1, 1)) -> Path:
    """A log of these, 100 ms apart, the first of them a HEARTBEAT of an autopilot."""
    first = mavlink.MAVLink_heartbeat_message(2, 3, 0x80, 0, 4, 3)
    with TlogWriter(path) as writer:
        for number, (message, source) in enumerate([(first, (1, 1)), *((one, who) for one in messages)]):
            mav = mavlink.MAVLink(None, srcSystem=source[0], srcComponent=source[1])
            writer.write(START + 100_000 * number, 0, bytes(message.pack(mav)))
    return path


def ulog_of(tmp_path: Path, *messages: mavlink.MAVLink_message, who: tuple[int, int] = (1, 1)) -> ULog:
    tmp_path.mkdir(exist_ok=True)
    log = write(tmp_path / "log.tlog", *messages, who=who)
    export(log, "ulog", tmp_path / "out", as_json=True)
    return read(tmp_path / "out" / "vehicle-1.ulg")


# All that was said


def test_each_vehicle_has_a_file_that_goes_forward(folder: Path) -> None:
    assert sorted(path.name for path in folder.iterdir()) == [f"vehicle-{one}.ulg" for one in SYSTEMS]
    logs = [read(path) for path in sorted(folder.iterdir())]
    assert len({zero(log) for log in logs}) == 1
    for log in logs:
        assert zero(log) % 1_000_000 == 0
        for dataset in log.data_list:
            times = dataset.data["timestamp"]
            assert times[0] > 0
            assert (np.diff(times.astype(np.int64)) >= 0).all()


def test_every_message_of_the_log_is_there(run: Path, folder: Path) -> None:
    for system in SYSTEMS:
        log = read(folder / f"vehicle-{system}.ulg")
        compare(log, received(run / f"vehicle-{system}.tlog"), zero(log))


def test_any_message_of_the_dialect_can_be_told(tmp_path: Path) -> None:
    log = tmp_path / "all.tlog"
    everything(log)
    with log.open("ab") as file:  # so that there is a vehicle
        heartbeat = mavlink.MAVLink_heartbeat_message(2, 3, 0, 0, 4, 3)
        mav = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
        file.write((START + 40_000_000_000).to_bytes(8, "big") + bytes(heartbeat.pack(mav)))
    export(log, "ulog", tmp_path / "out", as_json=True)
    found = read(tmp_path / "out" / "vehicle-1.ulg")
    compare(found, received(log), zero(found))


def compare(log: ULog, expected: list[Heard], start: int) -> None:
    """Each message is where it should be, with all its values."""
    series = {}
    for dataset in log.data_list:
        if dataset.name.startswith("mavlink_"):
            first = tuple(int(dataset.data[name][0]) for name in ("link", "system", "component"))
            series[dataset.name, first] = [dataset.data, 0]
    for message in expected:
        key = f"mavlink_{message.name.lower()}", (message.link, message.system, message.component)
        data, row = series[key]
        series[key][1] += 1
        assert data["timestamp"][row] == message.time - start
        for name, value in message.fields.items():
            told = f"{name}_" if name == "timestamp" else name
            if isinstance(value, str):
                count = sum(other.startswith(f"{told}[") for other in data)
                raw = bytes(int(data[f"{told}[{k}]"][row]) & 0xFF for k in range(count))
                assert raw.split(b"\0")[0].decode("utf-8", "replace") == value
            elif isinstance(value, list):
                for k, item in enumerate(value):
                    assert same(data[f"{told}[{k}]"][row].item(), item), (key, name)
            else:
                assert same(data[told][row].item(), value), (key, name)
    assert all(len(data["timestamp"]) == done for data, done in series.values())


def test_no_two_fields_have_one_name() -> None:
    for number in identifiers():
        names = [name for _, name in mavlink_topic(kind(number)).fields]
        assert len({"timestamp", *names}) == len(names) + 1


# In PX4's words


def test_positions_are_what_the_autopilot_said(run: Path, folder: Path) -> None:
    for system in SYSTEMS:
        log = read(folder / f"vehicle-{system}.ulg")
        own = [one for one in received(run / f"vehicle-{system}.tlog") if one.link == 0]
        said = [one for one in own if (one.name, one.component) == ("LOCAL_POSITION_NED", 1)]
        data = log.get_dataset("vehicle_local_position").data
        assert (data["timestamp"] + zero(log)).tolist() == [one.time for one in said]
        for name in ("x", "y", "z", "vx", "vy", "vz"):
            np.testing.assert_array_equal(data[name], [one.fields[name] for one in said])
        assert data["xy_global"][-1]
        origin = next(one.fields for one in own if one.name == "GPS_GLOBAL_ORIGIN")
        assert data["ref_lat"][-1] == origin["latitude"] / 1e7
        globe = [one for one in own if (one.name, one.component) == ("GLOBAL_POSITION_INT", 1)]
        data = log.get_dataset("vehicle_global_position").data
        np.testing.assert_array_equal(data["lat"], [one.fields["lat"] / 1e7 for one in globe])
        np.testing.assert_allclose(data["alt"], [one.fields["alt"] / 1e3 for one in globe], rtol=1e-6)
        orders = [one for one in own if one.name == "SET_POSITION_TARGET_LOCAL_NED"]
        data = log.get_dataset("trajectory_setpoint").data
        for axis, name in enumerate("xyz"):
            np.testing.assert_array_equal(data[f"position[{axis}]"], [one.fields[name] for one in orders])


def test_angles_come_back_out_of_the_quaternions(run: Path, folder: Path) -> None:
    log = read(folder / "vehicle-12.ulg")
    PX4ULog(log).add_roll_pitch_yaw()
    said = [one.fields for one in received(run / "vehicle-12.tlog") if one.name == "ATTITUDE"]
    data = log.get_dataset("vehicle_attitude").data
    for name in ("roll", "pitch", "yaw"):
        off = np.exp(1j * data[name]) / np.exp(1j * np.array([fields[name] for fields in said]))
        assert np.abs(np.angle(off)).max() < 1e-6
    rates = log.get_dataset("vehicle_angular_velocity").data
    np.testing.assert_array_equal(rates["xyz[2]"], [fields["yawspeed"] for fields in said])


def setpoint(mask: int, frame: int = 1, system: int = 1) -> mavlink.MAVLink_message:
    numbers = [float(number) for number in range(1, 12)]
    return mavlink.MAVLink_set_position_target_local_ned_message(0, system, 1, frame, mask, *numbers)


ORDERED = [f"{name}[{k}]" for name in ("position", "velocity", "acceleration") for k in range(3)]


@pytest.mark.parametrize("bit", range(12))
def test_what_a_set_point_ignores_is_nothing(tmp_path: Path, bit: int) -> None:
    data = ulog_of(tmp_path, setpoint(1 << bit), who=(255, 190)).get_dataset("trajectory_setpoint").data
    told = [data[name][0].item() for name in (*ORDERED, "yaw", "yawspeed")]
    expected = [float(number) for number in range(1, 12)]
    # Bit 9 says that the acceleration is a force, which PX4's message does not have.
    silent = {9: (6, 7, 8), 10: (9,), 11: (10,)}.get(bit, (bit,))
    for k in silent:
        expected[k] = math.nan
    assert all(same(one, other) for one, other in zip(told, expected, strict=True))


def test_orders_to_others_and_in_other_frames_are_not_the_vehicle_s(tmp_path: Path) -> None:
    log = ulog_of(tmp_path, setpoint(0, frame=8), setpoint(0, system=2), who=(255, 190))
    assert "trajectory_setpoint" not in {dataset.name for dataset in log.data_list}
    assert len(log.get_dataset("mavlink_set_position_target_local_ned").data["timestamp"]) == 2


def test_texts_are_logged_with_their_severity(tmp_path: Path) -> None:
    said = mavlink.MAVLink_statustext_message(4, b"mind the gap")
    (own,) = ulog_of(tmp_path / "own", said).logged_messages
    assert (own.message, own.log_level_str()) == ("mind the gap", "WARNING")
    other = mavlink.MAVLink_statustext_message(200, b"hm")
    (told,) = ulog_of(tmp_path / "other", other, who=(255, 190)).logged_messages
    assert (told.message, told.log_level_str()) == ("[255/190] hm", "DEBUG")


def test_states_and_battery(tmp_path: Path) -> None:
    power = mavlink.MAVLink_sys_status_message(0, 0, 0, 0, 12_600, -1, 80, *[0] * 6)
    landed = mavlink.MAVLink_extended_sys_state_message(0, 1)
    log = ulog_of(tmp_path, power, landed)
    status = {name: values[0] for name, values in log.get_dataset("vehicle_status").data.items()}
    assert (status["arming_state"], status["system_type"], status["system_id"]) == (2, 2, 1)
    battery: dict[str, Any] = log.get_dataset("battery_status").data
    assert battery["voltage_v"][0] == pytest.approx(12.6)
    assert battery["remaining"][0] == pytest.approx(0.8)
    assert math.isnan(battery["current_a"][0])
    assert log.get_dataset("vehicle_land_detected").data["landed"][0]


# Logs of any kind


def test_several_vehicles_in_one_log_have_a_file_each(tmp_path: Path) -> None:
    with TlogWriter(tmp_path / "two.tlog") as writer:
        for number in range(20):
            system = (1, 2, 255)[number % 3]
            autopilot = 8 if system == 255 else 3
            message = mavlink.MAVLink_heartbeat_message(2, autopilot, 0, number, 4, 3)
            mav = mavlink.MAVLink(None, srcSystem=system, srcComponent=1)
            writer.write(START + number * 100_000, 0, bytes(message.pack(mav)))
    export(tmp_path / "two.tlog", "ulog", tmp_path / "out", as_json=True)
    for own in (1, 2):
        log = read(tmp_path / "out" / f"vehicle-{own}.ulg")
        speakers = {int(one.data["system"][0]) for one in log.data_list if one.name == "mavlink_heartbeat"}
        assert speakers == {own, 255}


def test_a_series_never_goes_back(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "back.tlog"
    crc = bytes((mavlink.MAVLink_heartbeat_message.crc_extra,))
    times = [0, 100, 200, 50, 60, 300]
    with TlogWriter(log) as writer:
        for time in times:
            payload = bytes((0, 0, 0, 0, 2, 3, 0, 4, 3))
            writer.write(START + time * 1000, 0, frame_v2(0, crc, (1, 1), 0, payload))
    export(log, "ulog", tmp_path / "out", as_json=True)
    told = read(tmp_path / "out" / "vehicle-1.ulg").get_dataset("mavlink_heartbeat").data["timestamp"]
    assert np.diff(told).tolist() == [100_000, 100_000, 100_000]
    # In the dialect's words and in PX4's.
    assert json.loads(capsys.readouterr().out)["out_of_order"] == 4
