"""Logs of flights: in the firmware's format, read by the firmware's own readers, listed and downloaded."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink import DFReader
from pymavlink.dialects.v20 import all as dialect
from pyulog import ULog

from sitl.autopilot.parameters.parameter import Kind
from sitl.autopilot.parameters.px4 import table
from tests.sitl.autopilot_rig import ARM, FLAVOURS, LAND, Rig
from tests.sitl.ftp_client import Ftp
from tests.sitl.outside_client import Client

FIRST = {"ardupilot": 1, "px4": 0}
DRIFT_PPM = 10_000.0


def flown(flavour: str) -> Client:
    rig = Rig(flavour, tick=10_000, streams="normal", epoch=1_700_000_000_000_000).hover(4.0)
    client = Client(rig)
    rig.most = 2
    client.command(LAND)
    client.wait(14.0)
    assert not rig.autopilot.armed
    return client


@pytest.fixture(scope="module", params=FLAVOURS)
def client(request):
    return flown(request.param)


def listed(client: Client) -> list[Any]:
    return [
        m
        for m in client.send(dialect.MAVLink_log_request_list_message(11, 1, 0, 0xFFFF))
        if m.get_type() == "LOG_ENTRY"
    ]


def download(client: Client, entry: Any, offset: int = 0, count: int = 0xFFFFFFFF) -> bytes:
    client.received.clear()
    client.send(dialect.MAVLink_log_request_data_message(11, 1, entry.id, offset, count))
    wanted = min(offset + count, entry.size)
    while not any(m.ofs + m.count >= wanted for m in client.of("LOG_DATA")):
        client.wait(0.1)
    return b"".join(bytes(m.data[: m.count]) for m in client.of("LOG_DATA"))


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_without_a_flight_the_list_is_empty(flavour):
    (entry,) = listed(Client(Rig(flavour, streams="normal")))
    assert (entry.id, entry.num_logs, entry.last_log_num, entry.size) == (0, 0, 0, 0)


def test_the_log_is_listed_and_downloaded_whole_and_in_parts_by_both_protocols(client):
    flavour = client.rig.flavour
    (entry,) = listed(client)
    assert (entry.id, entry.num_logs, entry.last_log_num) == (FIRST[flavour], 1, FIRST[flavour])
    assert 1_700_000_010 < entry.time_utc < 1_700_000_060
    whole = download(client, entry)
    assert len(whole) == entry.size
    assert download(client, entry, 1000, 500) == whole[1000:1500]
    path = {"ardupilot": "APM/LOGS/00000001.BIN", "px4": "fs/microsd/log/sess001/log001.ulg"}[flavour]
    assert Ftp(client).burst(path) == whole


def test_the_firmwares_readers_find_the_flight(client, tmp_path: Path):
    (entry,) = listed(client)
    data = download(client, entry)
    if client.rig.flavour == "px4":
        log = ULog(io.BytesIO(data))
        assert not log.file_corruption
        height = -log.get_dataset("vehicle_local_position").data["z"]
        assert set(log.get_dataset("vehicle_status").data["arming_state"]) == {1, 2}
        assert log.initial_parameters["COM_OF_LOSS_T"] == pytest.approx(1.0)
        whole = {one.name for one in table(6) if one.kind is not Kind.REAL32}
        assert {name for name, value in log.initial_parameters.items() if isinstance(value, int)} == whole
        assert log.get_dataset("vehicle_attitude").data["q[0]"].min() > 0.9
    else:
        file = tmp_path / "1.BIN"
        file.write_bytes(data)
        reader = DFReader.DFReader_binary(str(file))
        kinds: dict[str, list[Any]] = {}
        while (message := reader.recv_msg()) is not None:
            kinds.setdefault(message.get_type(), []).append(message)
        reader.close()
        height = [m.RelHomeAlt for m in kinds["POS"]]
        assert [m.Id for m in kinds["EV"]] == [10, 11]
        assert {m.ModeNum for m in kinds["MODE"]} == {4, 9}
        assert {m.Name: m.Value for m in kinds["PARM"]}["GUID_TIMEOUT"] == 3.0
    assert len(height) > 100
    assert max(height) == pytest.approx(4.0, abs=0.3)
    assert abs(height[-1]) < 0.1


def test_all_records_of_a_log_have_times_of_the_vehicles_clock(tmp_path: Path):
    """So their times never go back, however wrong the clock is."""
    client = Client(
        Rig("ardupilot", tick=10_000, streams="normal", clock_drift_ppm=DRIFT_PPM, ready_after=8.0)
    )
    client.wait(9.0)
    for command in ((176, 1, 4), (ARM, 1), (176, 1, 17), (ARM, 0)):
        assert client.command(*command) == 0
        client.wait(0.35)
    client.rig.most = 2
    (entry,) = listed(client)
    file = tmp_path / "1.BIN"
    file.write_bytes(download(client, entry))
    reader, times = DFReader.DFReader_binary(str(file)), []
    while (message := reader.recv_msg()) is not None:
        if message.get_type() != "FMT":
            times.append(message.TimeUS)
    reader.close()
    assert times == sorted(times)


def test_ardupilot_gives_no_log_while_armed_and_px4_does():
    for flavour in FLAVOURS:
        client = Client(Rig(flavour, tick=10_000, streams="normal", start_height=5.0))
        client.wait(1.0)
        assert bool(listed(client)) == (flavour == "px4")
        assert ("Disarm for log download" in client.texts) == (flavour == "ardupilot")


def test_erasing_leaves_no_log_and_ends_downloads():
    client = flown("ardupilot")
    (entry,) = listed(client)
    client.send(dialect.MAVLink_log_request_data_message(11, 1, entry.id, 0, 0xFFFFFFFF))
    client.send(dialect.MAVLink_log_erase_message(11, 1))
    client.received.clear()
    client.wait(1.0)
    assert not client.of("LOG_DATA")
    assert listed(client)[0].num_logs == 0
    assert client.command(176, 1, 4) == 0
    assert client.command(ARM, 1) == 0


def test_a_download_ends_when_the_client_says_so(client):
    (entry,) = listed(client)
    client.send(dialect.MAVLink_log_request_data_message(11, 1, entry.id, 0, 0xFFFFFFFF))
    client.send(dialect.MAVLink_log_request_end_message(11, 1))
    client.received.clear()
    client.wait(0.5)
    assert not client.of("LOG_DATA")


@settings(max_examples=100, deadline=None)
@given(
    number=st.integers(0, 0xFFFF),
    offset=st.integers(0, 0xFFFFFFFF),
    count=st.integers(0, 0xFFFFFFFF),
    span=st.tuples(st.integers(0, 0xFFFF), st.integers(0, 0xFFFF)),
    known=st.booleans(),
)
def test_any_request_is_within_the_log(client, number, offset, count, span, known):
    (entry,) = listed(client)
    number = entry.id if known else number
    client.received.clear()
    client.send(
        dialect.MAVLink_log_request_list_message(11, 1, *span),
        dialect.MAVLink_log_request_data_message(11, 1, number, offset, count),
    )
    client.wait(0.05)
    client.send(dialect.MAVLink_log_request_end_message(11, 1))
    assert all(span[0] <= m.id <= span[1] for m in client.of("LOG_ENTRY"))
    for m in client.of("LOG_DATA"):
        assert m.id == entry.id
        assert m.count == 0 or offset <= m.ofs < m.ofs + m.count <= min(entry.size, offset + count)
    assert bool(client.of("LOG_DATA")) == (number == entry.id)
