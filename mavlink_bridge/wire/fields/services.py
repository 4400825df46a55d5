"""Fields of the messages in ``messages.services``."""

from __future__ import annotations

from mavlink_bridge import messages as m
from mavlink_bridge.errors import EncodeError
from mavlink_bridge.key import Key
from mavlink_bridge.wire.fields.units import Fields, degrees_e7, on_globe

NAME_LENGTH = 16
FILE_LENGTH = 251


def _name(field: bytes) -> str:
    return field.split(b"\0", 1)[0].decode("ascii", errors="replace").replace("\ufffd", "?")


def _name_field(name: str) -> bytes:
    data = name.encode("ascii", errors="replace")
    if len(data) > NAME_LENGTH:
        raise EncodeError(f"param_id = {name} is longer than {NAME_LENGTH} characters")
    return data


def _four(raw: bytes) -> bytes:
    if len(raw) != 4:
        raise EncodeError(f"param_value = {raw.hex()} is not four bytes")
    return raw


def param_request_read(s: m.Source, f: Fields) -> m.ParamRequestRead:
    """Decode PARAM_REQUEST_READ."""
    return m.ParamRequestRead(s, f[0], f[1], f[2], _name(f[3]))


def param_request_read_fields(x: m.ParamRequestRead) -> Fields:
    """Encode PARAM_REQUEST_READ."""
    return x.number, x.target_system, x.target_component, _name_field(x.name)


def param_value(s: m.Source, f: Fields) -> m.ParamValue:
    """Decode PARAM_VALUE."""
    return m.ParamValue(s, f[0], f[1], f[2], _name(f[3]), f[4])


def param_value_fields(x: m.ParamValue) -> Fields:
    """Encode PARAM_VALUE."""
    return _four(x.raw), x.total, x.number, _name_field(x.name), x.type


def param_set(s: m.Source, f: Fields) -> m.ParamSet:
    """Decode PARAM_SET."""
    return m.ParamSet(s, f[0], f[1], f[2], _name(f[3]), f[4])


def param_set_fields(x: m.ParamSet) -> Fields:
    """Encode PARAM_SET."""
    return _four(x.raw), x.target_system, x.target_component, _name_field(x.name), x.type


def set_origin(s: m.Source, f: Fields) -> m.SetGpsGlobalOrigin | None:
    """Decode SET_GPS_GLOBAL_ORIGIN; return None if a field is invalid."""
    latitude, longitude, altitude, system, time = f
    if not on_globe(latitude, longitude):
        return None
    return m.SetGpsGlobalOrigin(s, latitude / 1e7, longitude / 1e7, altitude / 1e3, system, time)


def set_origin_fields(x: m.SetGpsGlobalOrigin) -> Fields:
    """Encode SET_GPS_GLOBAL_ORIGIN; raise EncodeError for a value that does not fit."""
    return (
        degrees_e7("latitude", x.latitude, 90),
        degrees_e7("longitude", x.longitude, 180),
        round(x.altitude * 1e3),
        x.target_system,
        x.time,
    )


def file_transfer_fields(x: m.FileTransfer) -> Fields:
    """Encode FILE_TRANSFER_PROTOCOL; raise EncodeError for a value that does not fit."""
    if len(x.payload) > FILE_LENGTH:
        raise EncodeError(f"FILE_TRANSFER_PROTOCOL: {len(x.payload)} bytes are more than {FILE_LENGTH}")
    return x.target_network, x.target_system, x.target_component, bytes(x.payload)


def home(s: m.Source, f: Fields) -> m.HomePosition | None:
    """Decode HOME_POSITION; return None if a field is invalid."""
    if not on_globe(f[0], f[1]):
        return None
    return m.HomePosition(s, f[0] / 1e7, f[1] / 1e7, f[2] / 1e3, f[3:6], f[6:10], f[10:13], f[13])


def home_fields(x: m.HomePosition | m.SetHomePosition) -> Fields:
    """Encode HOME_POSITION and SET_HOME_POSITION; raise EncodeError for a value that does not fit."""
    place = (
        degrees_e7("latitude", x.latitude, 90),
        degrees_e7("longitude", x.longitude, 180),
        round(x.altitude * 1e3),
    )
    system = (x.target_system,) if isinstance(x, m.SetHomePosition) else ()
    return (*place, *x.position_ned, *x.attitude, *x.approach, *system, x.time)


def set_home(s: m.Source, f: Fields) -> m.SetHomePosition | None:
    """Decode SET_HOME_POSITION; return None if a field is invalid."""
    if not on_globe(f[0], f[1]):
        return None
    return m.SetHomePosition(s, f[0] / 1e7, f[1] / 1e7, f[2] / 1e3, f[3:6], f[6:10], f[10:13], f[13], f[14])


def setup_signing(s: m.Source, f: Fields) -> m.SetupSigning:
    """Decode SETUP_SIGNING."""
    return m.SetupSigning(s, f[0], f[1], f[2], Key(f[3]))


def setup_signing_fields(x: m.SetupSigning) -> Fields:
    """Encode SETUP_SIGNING."""
    return x.since, x.target_system, x.target_component, bytes(x.key)
