"""Messages of an autopilot's services: parameters, streams, files, home."""

from __future__ import annotations

from typing import NamedTuple

from mavlink_bridge.key import Key
from mavlink_bridge.messages.source import Source, Vector


class SetMode(NamedTuple):
    """SET_MODE (11), which older tools send instead of a command."""

    source: Source
    custom_mode: int
    target_system: int
    base_mode: int


class ParamRequestRead(NamedTuple):
    """PARAM_REQUEST_READ (20): by ``number``, or by ``name`` if that is −1."""

    source: Source
    number: int
    target_system: int
    target_component: int
    name: str


class ParamRequestList(NamedTuple):
    """PARAM_REQUEST_LIST (21)."""

    source: Source
    target_system: int
    target_component: int


class ParamValue(NamedTuple):
    """PARAM_VALUE (22): parameter ``number`` of ``total``.

    ``raw``: the four bytes of the value as sent. Their meaning depends on the firmware, and an integer in
    them may look like a signalling NaN, which a conversion to float would change.
    """

    source: Source
    raw: bytes
    total: int
    number: int
    name: str
    type: int


class ParamSet(NamedTuple):
    """PARAM_SET (23); ``raw`` as in ``ParamValue``."""

    source: Source
    raw: bytes
    target_system: int
    target_component: int
    name: str
    type: int


class SetGpsGlobalOrigin(NamedTuple):
    """SET_GPS_GLOBAL_ORIGIN (48)."""

    source: Source
    latitude: float
    longitude: float
    altitude: float
    target_system: int
    time: int


class RequestDataStream(NamedTuple):
    """REQUEST_DATA_STREAM (66): ``rate`` in Hz; ``start`` 1 or 0."""

    source: Source
    rate: int
    target_system: int
    target_component: int
    stream: int
    start: int


class FileTransfer(NamedTuple):
    """FILE_TRANSFER_PROTOCOL (110): 251 bytes of MAVLink FTP."""

    source: Source
    target_network: int
    target_system: int
    target_component: int
    payload: bytes


class AutopilotVersion(NamedTuple):
    """AUTOPILOT_VERSION (148).

    ``capabilities`` are MAV_PROTOCOL_CAPABILITY; versions are four bytes, the most significant first; custom
    versions have eight bytes, ``uid2`` has 18.
    """

    source: Source
    capabilities: int
    uid: int
    flight_version: int
    middleware_version: int
    os_version: int
    board_version: int
    vendor: int
    product: int
    flight_custom: bytes
    middleware_custom: bytes
    os_custom: bytes
    uid2: bytes


class HomePosition(NamedTuple):
    """HOME_POSITION (242); ``attitude`` (w, x, y, z) at home and ``approach`` (m) are NaN if unknown."""

    source: Source
    latitude: float
    longitude: float
    altitude: float
    position_ned: Vector
    attitude: tuple[float, float, float, float]
    approach: Vector
    time: int


class SetHomePosition(NamedTuple):
    """SET_HOME_POSITION (243), as ``HomePosition``."""

    source: Source
    latitude: float
    longitude: float
    altitude: float
    position_ned: Vector
    attitude: tuple[float, float, float, float]
    approach: Vector
    target_system: int
    time: int


class MessageInterval(NamedTuple):
    """MESSAGE_INTERVAL (244): ``interval`` in µs; −1: not sent; 0: no such message."""

    source: Source
    interval: int
    message_id: int


class SetupSigning(NamedTuple):
    """SETUP_SIGNING (256): sign with ``key`` from now on.

    ``since`` is the current time (10 µs since 2015). Zeros in both end signing.
    """

    source: Source
    since: int
    target_system: int
    target_component: int
    key: Key
