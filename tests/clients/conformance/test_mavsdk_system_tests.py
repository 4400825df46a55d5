"""mavlink/MAVSDK, src/system_tests: transfers over a link that loses messages, parameters, files."""

from __future__ import annotations

import struct
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as dialect

from tests.clients.conformance.stand import ARM, COPTER, SET_MODE, Stand
from tests.sitl.autopilot_rig import FLAVOURS
from tests.sitl.ftp_client import CRC, LIST, NAK, OPEN, Ftp
from tests.sitl.mission_client import Way, at, item, ways

pytestmark = pytest.mark.slow
LOST = ("MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_REQUEST_LIST", "MISSION_COUNT", "MISSION_ITEM_INT")


@pytest.fixture(params=FLAVOURS)
def client(request: pytest.FixtureRequest) -> Stand:
    return Stand(request.param)


class Lossy:
    """A link that drops 5 % of mission messages both ways, and a client that repeats after 0.5 s."""

    def __init__(self, client: Stand, seed: int) -> None:
        self.client, self.random, self.dropped = client, np.random.default_rng(seed), 0

    def passes(self, message: Any) -> bool:
        kept = message.get_type() not in LOST or self.random.random() >= 0.05
        self.dropped += not kept
        return kept

    def ask(self, message: Any, *kinds: str) -> Any:
        """Send, with up to five repetitions, until one of ``kinds`` comes."""
        for _ in range(6):
            found = self.client.send(message) if self.passes(message) else []
            for _ in range(50):
                for answer in found:
                    if answer.get_type() in kinds and self.passes(answer):
                        return answer
                found = self.client.wait(0.01)
        raise AssertionError(f"no {kinds}")


@pytest.mark.parametrize("seed", range(5))
def test_mission_transfer_lossy(client: Stand, seed: int) -> None:
    """mission_transfer_lossy.cpp, MissionTransferLossy: 20 items go up and come back equal."""
    link = Lossy(client, seed)
    plan = [Way(16), *(at(30 + 0.1 * k, 0.1 * k, 10 + 0.25 * k) for k in range(20))]
    answer = link.ask(
        dialect.MAVLink_mission_count_message(11, 1, len(plan), 0),
        "MISSION_REQUEST",
        "MISSION_REQUEST_INT",
        "MISSION_ACK",
    )
    while answer.get_type() != "MISSION_ACK":
        answer = link.ask(
            item(plan[answer.seq], answer.seq), "MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_ACK"
        )
    assert answer.type == 0
    total = link.ask(dialect.MAVLink_mission_request_list_message(11, 1, 0), "MISSION_COUNT").count
    assert total == len(plan)
    back = [
        link.ask(dialect.MAVLink_mission_request_int_message(11, 1, seq, 0), "MISSION_ITEM_INT")
        for seq in range(total)
    ]
    assert [m.seq for m in back] == list(range(total))
    assert ways(back) == ways([item(way, seq) for seq, way in enumerate(plan)])


def test_sequence_numbers_have_no_gap(client: Stand) -> None:
    """mavlink_seq.cpp, MavlinkSeqSequential."""
    numbers = [m.get_seq() for m in client.wait(5.0)]
    assert len(numbers) >= 10
    assert all((b - a) % 256 == 1 for a, b in pairwise(numbers))


def test_all_parameters_are_listed_and_equal_to_each_alone(client: Stand) -> None:
    """param_get_all.cpp, ParamGetAll."""
    client.send(dialect.MAVLink_param_request_list_message(11, 1))
    client.wait(2.0)
    listed = {m.param_id: m for m in client.of("PARAM_VALUE") if m.param_id != "_HASH_CHECK"}
    assert len(listed) == client.last("PARAM_VALUE").param_count
    assert {m.param_index for m in listed.values()} == set(range(len(listed)))
    for name, one in listed.items():
        client.send(dialect.MAVLink_param_request_read_message(11, 1, name.encode(), -1))
        again = client.last("PARAM_VALUE")
        assert struct.pack("<f", again.param_value) == struct.pack("<f", one.param_value)
        assert again.param_type == one.param_type


def test_a_parameter_is_set_and_read(client: Stand) -> None:
    """param_set_and_get.cpp, ParamSetAndGet: the new value comes back, an unknown name does not."""
    name = {"ardupilot": "GUID_TIMEOUT", "px4": "COM_OF_LOSS_T"}[client.rig.flavour]
    client.set_parameter(name, 2.5)
    client.send(dialect.MAVLink_param_request_read_message(11, 1, name.encode(), -1))
    assert client.last("PARAM_VALUE").param_value == 2.5
    found = client.send(dialect.MAVLink_param_request_read_message(11, 1, b"NO_SUCH_PARAM", -1))
    assert not [m for m in found if m.get_type() == "PARAM_VALUE"]


def test_arm_and_disarm(client: Stand) -> None:
    """action_arm_disarm.cpp, ActionArmDisarm."""
    if client.rig.flavour == "ardupilot":
        assert client.command(SET_MODE, 1, COPTER["GUIDED"]) == 0
    assert client.command(ARM, 1) == 0
    client.wait(1.1)
    assert client.armed
    assert client.command(ARM, 0) == 0
    client.wait(1.1)
    assert not client.armed


def test_files_are_downloaded_also_by_bursts_and_compared(client: Stand) -> None:
    """ftp_download_file.cpp, ftp_download_file_burst.cpp, ftp_compare_files.cpp, ftp_list_dir.cpp."""
    ftp = Ftp(client)
    data = ftp.read("@PARAM/param.pck")
    assert len(data) > 1000
    assert ftp.burst("@PARAM/param.pck") == data
    assert ftp.ask(CRC, b"@PARAM/param.pck").data != ftp.ask(CRC, b"@PARAM/param.pck?withdefaults=1").data
    assert ftp.entries("@PARAM") == [f"Fparam.pck\t{len(data)}"]
    for opcode in (OPEN, LIST, CRC):
        missing = ftp.ask(opcode, b"absent")
        assert (missing.said, missing.data) == (NAK, b"\x0a")


def test_a_burst_that_loses_packets_is_completed_by_reads(client: Stand) -> None:
    """ftp_download_file_burst.cpp, FtpDownloadBurstBigFileLossy: every lost part can be read again."""
    ftp = Ftp(client)
    random = np.random.default_rng(1)
    whole = ftp.read("@PARAM/param.pck")
    session, length = ftp.open("@PARAM/param.pck")
    parts: dict[int, bytes] = {}
    for offset in range(0, length, 80):
        if random.random() >= 0.3:
            parts[offset] = ftp.ask(5, session=session, offset=offset, size=80).data
    for offset in range(0, length, 80):
        if offset not in parts:
            parts[offset] = ftp.ask(5, session=session, offset=offset, size=80).data
    assert b"".join(parts[offset] for offset in sorted(parts)) == whole
