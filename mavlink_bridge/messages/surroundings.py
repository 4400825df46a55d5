"""Messages about the surroundings: tracked targets, obstacle distances, air traffic; and figures to plot."""

from __future__ import annotations

from typing import NamedTuple

from mavlink_bridge.messages.source import Source, Vector


class AdsbVehicle(NamedTuple):
    """ADSB_VEHICLE (246): an aircraft that a receiver detected ``age`` (µs, whole seconds) ago.

    Degrees; altitude m (``geometric``: by satellite; otherwise by pressure), course rad clockwise from north,
    speed and climb m/s (up); None where the receiver marks them invalid. ``address``: ICAO's.
    """

    source: Source
    address: int
    latitude: float
    longitude: float
    altitude: float | None
    geometric: bool
    course: float | None
    speed: float | None
    climb: float | None
    callsign: str
    emitter: int
    age: int


class NamedValue(NamedTuple):
    """NAMED_VALUE_FLOAT (251): a figure for a ground station to plot; ``name`` of at most 10 characters."""

    source: Source
    time_boot: int
    name: str
    value: float


class CameraTrackingGeo(NamedTuple):
    """CAMERA_TRACKING_GEO_STATUS (276): position of the object that a camera tracks.

    Degrees, m above mean sea level, m/s NED or None. ``status`` is CAMERA_TRACKING_STATUS_FLAGS: 1 while it
    tracks. The message has no time stamp.
    """

    source: Source
    status: int
    latitude: float
    longitude: float
    altitude: float
    velocity_ned: Vector | None


class ObstacleDistance(NamedTuple):
    """OBSTACLE_DISTANCE (330): distance (m) of the nearest obstacle in each of 72 sectors.

    A distance is None where it is unknown, and more than ``max_distance`` where there is no obstacle.

    The middle of sector k is at ``offset + k·increment`` (rad, clockwise from above) from north, or from the
    nose if ``frame`` is MAV_FRAME_BODY_FRD (12). ``time``: µs, on the sender's clock.
    """

    source: Source
    time: int
    sensor: int
    distances: tuple[float | None, ...]
    increment: float
    min_distance: float
    max_distance: float
    offset: float
    frame: int
