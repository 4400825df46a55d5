"""Files by MAVLink FTP: parameters in ArduPilot's packed format, PX4's component metadata, sessions."""

from __future__ import annotations

import json
import lzma
import struct
import zlib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as dialect

from mavlink_bridge.messages import ComponentMetadata, ParamValue
from tests.sitl.autopilot_rig import FLAVOURS, REQUEST, Rig
from tests.sitl.ftp_client import ACK, BURST, CRC, NAK, OPEN, READ, RESET, TERMINATE, Ftp, answers
from tests.sitl.outside_client import Client

LAYOUTS = {1: "<b", 2: "<h", 3: "<i", 4: "<f"}


def up(flavour: str) -> Ftp:
    client = Client(Rig(flavour, tick=10_000))
    client.wait(1.2)
    return Ftp(client)


def unpacked(data: bytes) -> tuple[tuple[int, int, int], dict[str, tuple[int, float, float | None]]]:
    """Header, and type, value and default of each parameter, as the format's description has them."""
    head: tuple[int, int, int] = struct.unpack_from("<HHH", data)
    found: dict[str, tuple[int, float, float | None]] = {}
    at, name = 6, ""
    while at < len(data):
        kind, more = data[at] & 15, data[at] >> 4
        shared, length = data[at + 1] & 15, (data[at + 1] >> 4) + 1
        name = name[:shared] + data[at + 2 : at + 2 + length].decode()
        at += 2 + length
        layout = struct.Struct(LAYOUTS[kind])
        (value,) = layout.unpack_from(data, at)
        at += layout.size
        default = None
        if more & 1:
            (default,) = layout.unpack_from(data, at)
            at += layout.size
        found[name] = kind, value, default
    return head, found


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_the_packed_parameters_are_those_of_the_parameter_protocol(flavour):
    ftp = up(flavour)
    ftp.client.send(dialect.MAVLink_param_request_list_message(11, 1))
    ftp.client.wait(1.0)
    listed = {p.name: p for p in ftp.client.rig.all(ParamValue) if p.name != "_HASH_CHECK"}
    for data in (ftp.read("@PARAM/param.pck"), ftp.burst("@PARAM/param.pck", 80)):
        (magic, count, total), found = unpacked(data)
        assert (magic, count, total) == (0x671B, len(listed), len(listed))
        assert found.keys() == listed.keys()
        for name, (kind, value, default) in found.items():
            layout = "<i" if flavour == "px4" and kind != 4 else "<f"
            assert struct.unpack(layout, listed[name].raw)[0] == value
            assert default is None


def test_a_query_selects_parameters_and_adds_defaults_that_differ():
    ftp = up("ardupilot")
    before = unpacked(ftp.read("@PARAM/param.pck"))[1]
    ftp.client.send(dialect.MAVLink_param_set_message(11, 1, b"GUID_TIMEOUT", 4.5, 9))
    (magic, _, _), found = unpacked(ftp.read("@PARAM/param.pck?withdefaults=1"))
    assert magic == 0x671C
    assert found["GUID_TIMEOUT"][1:] == (4.5, before["GUID_TIMEOUT"][1])
    assert all(default is None for name, (_, _, default) in found.items() if name != "GUID_TIMEOUT")
    (_, count, total), part = unpacked(ftp.read("@PARAM/param.pck?start=3&count=5"))
    assert (count, total, list(part)) == (5, len(before), list(before)[3:8])


def test_component_metadata_names_files_with_their_checksums():
    ftp = up("px4")
    assert ftp.client.command(REQUEST, 397) == 0
    (said,) = ftp.client.rig.all(ComponentMetadata)
    path = said.uri.removeprefix("mftp://")
    general = ftp.read(path)
    checksum = zlib.crc32(general, 0xFFFFFFFF) ^ 0xFFFFFFFF
    assert said.crc == checksum == int.from_bytes(ftp.ask(CRC, path.encode()).data, "little")
    (parameters,) = json.loads(lzma.decompress(general))["metadataTypes"]
    data = ftp.burst(parameters["uri"].removeprefix("mftp://"))
    assert parameters["fileCrc"] == zlib.crc32(data, 0xFFFFFFFF) ^ 0xFFFFFFFF
    named = {p["name"] for p in json.loads(lzma.decompress(data))["parameters"]}
    assert named == unpacked(ftp.read("@PARAM/param.pck"))[1].keys()
    assert up("ardupilot").client.command(REQUEST, 397) == 3


def test_directories_lead_to_the_files():
    ftp = up("px4")
    assert ftp.entries("/") == ["D@PARAM", "Detc"]
    assert ftp.entries("etc") == ["Dextras"]
    for entry in ftp.entries("etc/extras"):
        name, size = entry[1:].split("\t")
        assert len(ftp.read(f"/etc/extras/{name}")) == int(size)


def test_sessions_are_numbered_by_the_client_of_ardupilot_and_by_px4_itself():
    assert up("ardupilot").open("@PARAM/param.pck", 7)[0] == 7
    ftp = up("px4")
    assert [ftp.open("@PARAM/param.pck", 7)[0] for _ in range(3)] == [0, 1, 2]
    again = ftp.request(OPEN, b"@PARAM/param.pck")
    first, second = (answers(ftp.client.send(again))[0] for _ in range(2))
    assert first == second
    assert ftp.ask(RESET).said == ACK
    assert ftp.ask(READ, session=0).said == NAK


def test_a_full_table_of_sessions_is_refused_until_one_has_been_idle():
    ftp = up("px4")
    for _ in range(16):
        ftp.open("@PARAM/param.pck")
    refused = ftp.ask(OPEN, b"@PARAM/param.pck")
    assert (refused.said, refused.data) == (NAK, b"\x05")
    ftp.client.wait(3.1)
    assert ftp.open("@PARAM/param.pck")[1] > 0


def test_a_burst_ends_with_its_session():
    ftp = up("px4")
    number, _ = ftp.open("@PARAM/param.pck")
    assert answers(ftp.client.send(ftp.request(BURST, b"", number, 0, 1)))
    assert ftp.ask(TERMINATE, session=number).said == ACK
    assert ftp.open("@PARAM/param.pck")[0] == number
    assert answers(ftp.client.wait(0.1)) == []


@settings(max_examples=200, deadline=None)
@given(requests=st.lists(st.binary(min_size=0, max_size=251), max_size=20), flavour=st.sampled_from(FLAVOURS))
def test_any_request_is_answered_and_does_no_harm(requests, flavour):
    ftp = FUZZED[flavour]
    for data in requests:
        payload = data.ljust(251, b"\0")
        message = dialect.MAVLink_file_transfer_protocol_message(0, 11, 1, payload)
        found = answers(ftp.client.send(message))
        if payload[3] < ACK and payload[3] != 15:
            assert payload[3] in [answer.asked for answer in found]
    ftp.client.wait(0.02)
    ftp.ask(RESET)
    assert ftp.ask(OPEN, b"@PARAM/param.pck").said == ACK


FUZZED = {flavour: up(flavour) for flavour in FLAVOURS}
