"""Parameters as an outside client sees them, in both dialects: their bytes are pymavlink's, not ours."""

from __future__ import annotations

import struct
import zlib
from operator import attrgetter
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as dialect

from mavlink_bridge.messages import ParamValue
from mavlink_bridge.wire import param_value
from mavlink_bridge.wire.codec import Codec
from sitl.autopilot.parameters import ardupilot, px4
from sitl.autopilot.parameters.parameter import Kind, Parameter
from sitl.autopilot.parameters.values import Values
from sitl.autopilot.saved import Saved
from sitl.config.autopilot import AutopilotConfig
from sitl.node import Autopilot
from tests.sitl.autopilot_rig import ARM, FIREFLY, FLAVOURS, SITE, VELOCITY_YAW, Rig, setpoint
from tests.sitl.outside_client import Client, only

TABLES = {"ardupilot": ardupilot.table(6), "px4": px4.table(6)}
BOUND = {"ardupilot": ardupilot.BOUND, "px4": px4.BOUND}
INTEGERS = {2: "<b", 4: "<h", 6: "<i"}


class BytewiseSetting(dialect.MAVLink_param_set_message):
    """PARAM_SET with the bytes of an integer; as a float it would lose a bit if it is a signalling NaN."""

    unpacker = struct.Struct("<iBB16sB")


def number_of(message: Any, flavour: str) -> float:
    """What PARAM_VALUE says, read as QGroundControl reads PX4 (a union) and ArduPilot (a cast)."""
    if flavour == "px4" and message.param_type == 6:
        return struct.unpack("<i", message.get_msgbuf()[10:14])[0]
    return message.param_value


def setting(name: str, value: float, kind: int, flavour: str) -> Any:
    if flavour == "px4" and kind == 6:
        return BytewiseSetting(11, 1, name.encode(), int(value), kind)
    return dialect.MAVLink_param_set_message(11, 1, name.encode(), float(value), kind)


def read(name: str, index: int = -1) -> Any:
    return dialect.MAVLink_param_request_read_message(11, 1, name.encode(), index)


def listed(client: Client) -> list[Any]:
    client.send(dialect.MAVLink_param_request_list_message(11, 1))
    client.wait(1.0)
    return client.of("PARAM_VALUE")


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_list_is_complete_in_order_and_soon(flavour):
    client = Client(Rig(flavour))
    values = listed(client)
    if flavour == "px4":
        first, *values = values
        assert first.param_id == "_HASH_CHECK"
    table = TABLES[flavour]
    assert [m.param_id for m in values] == [p.name for p in table]
    assert [m.param_index for m in values] == list(range(len(table)))
    assert {m.param_count for m in values} == {len(table)}
    assert [m.param_type for m in values] == [p.kind.value for p in table]
    assert len(table) > 150


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_values_that_are_not_bound_are_the_defaults(flavour):
    values = {m.param_id: number_of(m, flavour) for m in listed(Client(Rig(flavour)))}
    for p in TABLES[flavour]:
        if p.bound is None:
            assert values[p.name] == pytest.approx(p.default, rel=1e-6)


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_tables_are_sound(flavour):
    table = TABLES[flavour]
    assert len({p.name for p in table}) == len(table)
    for p in table:
        assert len(p.name) <= 16
        assert p.refusal(p.fitted(p.default)) is None
        assert p.kind in ((Kind.INT32, Kind.REAL32) if flavour == "px4" else tuple(Kind))
        if p.bound:
            attrgetter(p.bound.setting)(Rig(flavour).config)
    assert set(BOUND[flavour]) <= {p.name for p in table}
    if flavour == "px4":
        assert [p.name for p in table] == sorted(p.name for p in table)


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_every_bound_parameter_makes_valid_settings_at_both_ends(flavour):
    config = Rig(flavour).config
    for number, p in enumerate(TABLES[flavour]):
        if p.bound is None:
            continue
        options = [float(option) for option, _ in p.bound.options]
        for value in options or [max(p.low, -1e6), min(p.high, 3000.0)]:
            values = Values(TABLES[flavour], config, {})
            assert values.set(number, value) is None
            AutopilotConfig.model_validate(values.configured(config).model_dump())


def some_value(p: Parameter) -> st.SearchStrategy[float]:
    if p.bound and p.bound.options:
        return st.sampled_from([float(number) for number, _ in p.bound.options])
    bits = {Kind.INT8: 8, Kind.INT16: 16, Kind.INT32: 31}.get(p.kind)
    if bits is None:
        floats = st.floats(max(p.low, -1e30), min(p.high, 1e30))
        return floats.map(p.fitted).filter(lambda value: p.refusal(value) is None)
    low, high = max(p.low, -(1 << bits - 1)), min(p.high, (1 << bits - 1) - 1)
    # Beyond 24 bits ArduPilot's floats lose the last ones, as they do on the real one.
    return st.integers(int(max(low, -(1 << 24))), int(min(high, 1 << 24))).map(float)


@pytest.mark.parametrize("flavour", FLAVOURS)
@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_what_is_set_is_echoed_read_back_and_kept(flavour, data):
    p = data.draw(st.sampled_from(TABLES[flavour]))
    value = data.draw(some_value(p))
    client = Client(Rig(flavour))
    message = setting(p.name, value, p.kind.value, flavour)
    echo = only(client.send(message), "PARAM_VALUE")
    assert (echo.param_id, number_of(echo, flavour), echo.param_type) == (p.name, value, p.kind.value)
    again = only(client.send(message), "PARAM_VALUE")
    assert repr(again.to_dict()) == repr(echo.to_dict())  # a NaN is equal to itself
    number = TABLES[flavour].index(p)
    for found in (client.send(read(p.name)), client.send(read("", number))):
        assert number_of(only(found, "PARAM_VALUE"), flavour) == value
    assert only(client.send(read("", number)), "PARAM_VALUE").param_index == number
    saved = Saved.model_validate_json(client.rig.autopilot.saved.model_dump_json())
    reborn = Autopilot(client.rig.config, FIREFLY, SITE, seed=1, saved=saved)
    assert reborn.saved == saved
    assert reborn.saved.parameters.get(p.name, value) == value


@settings(max_examples=40, deadline=None)
@given(value=st.integers(-(2**31), 2**31 - 1))
@example(-4194305)
@example(0x7F800001)
def test_px4_integers_survive_whatever_float_they_look_like(value):
    """Also those whose bytes are a signalling NaN, as -4194305 (0xFFBFFFFF): in the simulation and as the
    companion reads them."""
    client = Client(Rig("px4"))
    echo = only(client.send(setting("CAL_ACC0_ID", value, 6, "px4")), "PARAM_VALUE")
    again = only(client.send(read("CAL_ACC0_ID")), "PARAM_VALUE")
    assert number_of(echo, "px4") == number_of(again, "px4") == value
    (decoded,) = Codec().feed(bytes(again.get_msgbuf()))
    assert isinstance(decoded, ParamValue)
    assert param_value.number_of(decoded, bytewise=True) == value


def frames_of(data: bytes) -> list[bytes]:
    found = []
    while data:
        length = 12 + data[1]
        found.append(data[:length])
        data = data[length:]
    return found


@pytest.mark.parametrize("flavour", FLAVOURS)
@pytest.mark.parametrize("value", [float("nan"), float("inf"), -1e38, 1e38])
def test_what_is_out_of_range_changes_nothing_and_is_explained(flavour, value):
    client = Client(Rig(flavour))
    name, kind = {"ardupilot": ("WPNAV_SPEED", 9), "px4": ("MPC_XY_CRUISE", 9)}[flavour]
    old = only(client.send(read(name)), "PARAM_VALUE").param_value
    found = client.send(dialect.MAVLink_param_set_message(11, 1, name.encode(), value, kind))
    assert only(found, "PARAM_VALUE").param_value == old
    assert client.texts[-1].startswith(name)
    assert client.rig.autopilot.saved.parameters == {}


STOCK = {
    "ardupilot": {
        "PSC_JERK_XY": 5.0,
        "PSC_POSXY_P": 1.0,
        "PSC_VELXY_P": 2.0,
        "PSC_VELXY_I": 1.0,
        "PSC_VELXY_D": 0.25,
        "PSC_ANGLE_MAX": 0.0,
        "WPNAV_ACCEL": 250.0,
        "WPNAV_SPEED": 1000.0,
        "ANGLE_MAX": 3000.0,
        "ATC_ACCEL_R_MAX": 110000.0,
        "ATC_ACCEL_P_MAX": 110000.0,
        "GUID_TIMEOUT": 3.0,
    },
    "px4": {
        "MPC_ACC_HOR": 3.0,
        "MPC_ACC_HOR_MAX": 5.0,
        "MPC_JERK_MAX": 8.0,
        "MPC_JERK_AUTO": 4.0,
        "MPC_XY_VEL_MAX": 12.0,
        "MPC_XY_CRUISE": 5.0,
        "MPC_XY_P": 0.95,
        "MPC_XY_VEL_P_ACC": 1.8,
        "MPC_TILTMAX_AIR": 45.0,
    },
}


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_what_decides_how_it_follows_is_as_in_the_stock_firmware(flavour):
    client = Client(Rig(flavour))
    for name, stock in STOCK[flavour].items():
        value = only(client.send(read(name)), "PARAM_VALUE").param_value
        assert value == pytest.approx(stock, abs=1e-6), name


def test_px4_refuses_a_wrong_type_and_ardupilot_casts():
    px, ap = Client(Rig("px4")), Client(Rig("ardupilot"))
    found = px.send(dialect.MAVLink_param_set_message(11, 1, b"COM_RC_IN_MODE", 3.0, 9))
    assert number_of(only(found, "PARAM_VALUE"), "px4") == 1
    assert px.texts == ["COM_RC_IN_MODE: wrong type"]
    found = ap.send(dialect.MAVLink_param_set_message(11, 1, b"RTL_ALT", 2000.4, 9))
    assert only(found, "PARAM_VALUE").param_value == 2000.0


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_unknown_names_and_numbers_and_other_vehicles_get_no_value(flavour):
    client = Client(Rig(flavour))
    client.send(read("NO_SUCH"), read("", 9999), setting("NO_SUCH", 1.0, 9, flavour))
    client.send(dialect.MAVLink_param_request_list_message(12, 1))
    client.wait(0.2)
    assert not client.of("PARAM_VALUE")


def test_the_hash_is_the_crc_of_names_and_values_and_changes_with_them():
    client = Client(Rig("px4"))
    values = listed(client)
    crc = 0
    for m in values[1:]:
        data = m.param_id.encode() + struct.pack("<f", m.param_value)
        crc = zlib.crc32(data, crc ^ 0xFFFFFFFF) ^ 0xFFFFFFFF
    (first,) = [f for f in frames_of(client.rig.bytes) if f[7] == 22 and f[18:29] == b"_HASH_CHECK"]
    assert int.from_bytes(first[10:14], "little") == crc
    assert (values[0].param_index, values[0].param_type) == (0xFFFF, 5)
    client.send(setting("COM_OF_LOSS_T", 0.7, 9, "px4"))
    seen = len(client.rig.bytes)
    client.send(read("_HASH_CHECK"))
    (later,) = [f for f in frames_of(client.rig.bytes[seen:]) if f[7] == 22]
    assert int.from_bytes(later[10:14], "little") != crc


def test_who_has_the_list_already_ends_it():
    client = Client(Rig("px4"))
    client.send(dialect.MAVLink_param_request_list_message(11, 1))
    client.send(dialect.MAVLink_param_set_message(11, 1, b"_HASH_CHECK", 0.0, 5))
    seen = len(client.of("PARAM_VALUE"))
    client.wait(1.0)
    assert len(client.of("PARAM_VALUE")) == seen < 30


# What they do


def drift_after_silence(client: Client) -> float:
    rig = client.rig
    rig.steer(4.0, setpoint(VELOCITY_YAW, velocity=(2.0, 0.0, 0.0)))
    before = rig.position[0]
    rig.run(8.0)
    return float(rig.position[0] - before)


def test_guid_timeout_says_how_far_it_drifts():
    drifts = []
    for seconds in (1.0, 3.0):
        client = Client(Rig("ardupilot").hover(5.0))
        client.send(setting("GUID_TIMEOUT", seconds, 9, "ardupilot"))
        drifts.append(drift_after_silence(client))
    assert drifts[1] - drifts[0] == pytest.approx(4.0, abs=0.3)


@pytest.mark.parametrize(("action", "mode"), [(5, (4, 3)), (4, (4, 6)), (3, (4, 5)), (0, (3, 0))])
def test_com_obl_rc_act_says_what_follows_a_lost_stream(action, mode):
    client = Client(Rig("px4").hover(5.0))
    client.send(setting("COM_OBL_RC_ACT", action, 6, "px4"), setting("COM_OF_LOSS_T", 0.5, 9, "px4"))
    client.rig.steer(2.0, setpoint(VELOCITY_YAW, velocity=(1.0, 0.0, 0.0)))
    client.rig.run(1.6)
    client.wait(1.0)
    custom = client.of("HEARTBEAT")[-1].custom_mode
    assert (custom >> 16 & 0xFF, custom >> 24) == mode


def test_a_system_id_counts_from_the_next_boot():
    client = Client(Rig("ardupilot"))
    client.send(setting("SYSID_THISMAV", 42, 4, "ardupilot"))
    client.wait(2.0)
    assert {m.get_srcSystem() for m in client.received} == {11}
    reborn = Autopilot(client.rig.config, FIREFLY, SITE, seed=1, saved=client.rig.autopilot.saved)
    assert reborn.name == "sitl-42"


def test_preflight_storage_makes_all_as_at_first():
    client = Client(Rig("ardupilot"))
    client.send(setting("GUID_TIMEOUT", 1.0, 9, "ardupilot"))
    assert client.command(245, 1) == 0
    assert client.rig.autopilot.saved.parameters == {"GUID_TIMEOUT": 1.0}
    assert client.command(245, 2) == 0
    assert client.rig.autopilot.saved.parameters == {}
    assert client.rig.autopilot.config == client.rig.config
    assert client.command(ARM, 7) == 2


def test_saved_values_that_make_no_sense_are_left_out():
    saved = Saved(parameters={"GUID_TIMEOUT": 1e6, "NO_SUCH": 1.0, "RTL_ALT": 2500.0})
    autopilot = Autopilot(Rig("ardupilot").config, FIREFLY, SITE, seed=1, saved=saved)
    assert autopilot.saved.parameters == {"RTL_ALT": 2500.0}
    assert autopilot.config.return_height == 25.0
