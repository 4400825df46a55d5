"""Laws of the frames: known places, exact inverses, rigidity, compass directions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_bridge.frames import (
    FleetFrame,
    enu_to_ned,
    ned_to_enu,
    wrap,
    yaw_to_enu,
    yaw_to_ned,
)

latitudes = st.floats(-85, 85)
longitudes = st.floats(-180, 180)
altitudes = st.floats(-100, 5000)
frames = st.builds(FleetFrame, latitudes, longitudes, altitudes)
metres = st.floats(-5000, 5000)
points = st.tuples(metres, metres, st.floats(-500, 500))
angles = st.floats(-100, 100)
offsets = st.floats(-0.05, 0.05)


def test_axes() -> None:
    assert ned_to_enu((1, 2, 3)).tolist() == [2, 1, -3]
    assert enu_to_ned([[0, 1, 0], [0, 0, 1]]).tolist() == [[1, 0, 0], [0, 0, -1]]


@given(st.lists(points, min_size=1, max_size=4))
def test_ned_and_enu_undo_each_other(vectors: list[tuple[float, float, float]]) -> None:
    assert np.array_equal(enu_to_ned(ned_to_enu(vectors)), np.array(vectors))


@pytest.mark.parametrize(
    ("yaw_enu", "yaw_ned"),
    [(0.0, math.pi / 2), (math.pi / 2, 0.0), (math.pi, -math.pi / 2), (-math.pi / 2, math.pi)],
    ids=["east", "north", "west", "south"],
)
def test_compass_points(yaw_enu: float, yaw_ned: float) -> None:
    assert yaw_to_ned(yaw_enu) == pytest.approx(yaw_ned)
    assert yaw_to_enu(yaw_ned) == pytest.approx(yaw_enu)


@given(angles)
def test_a_heading_is_one_direction_in_both_frames(yaw_enu: float) -> None:
    yaw_ned = yaw_to_ned(yaw_enu)
    ahead = (math.cos(yaw_ned), math.sin(yaw_ned), 0.0)
    assert ned_to_enu(ahead) == pytest.approx([math.cos(yaw_enu), math.sin(yaw_enu), 0], abs=1e-12)


@given(angles)
def test_wrap(angle: float) -> None:
    turned = wrap(angle)
    assert -math.pi < turned <= math.pi
    assert wrap(turned) == turned
    assert math.remainder(angle - turned, math.tau) == pytest.approx(0, abs=1e-12)


def test_wrap_at_the_ends_and_off_the_line() -> None:
    assert wrap(-math.pi) == wrap(math.pi) == math.pi
    assert math.isnan(wrap(math.nan))


def test_known_distances_on_wgs84() -> None:
    """A degree of the meridian at 45° is 111 131.8 m, of the equator 111 319.5 m (WGS84 series; chord
    shortens by 1.4 m)."""
    step = 1e-3
    north = FleetFrame(45.0, 7.0, 0.0).to_enu(45.0 + step, 7.0, 0.0)
    east = FleetFrame(0.0, 7.0, 0.0).to_enu(0.0, 7.0 + step, 0.0)
    assert north == pytest.approx([0, 111.1318, 0], abs=2e-3)
    assert east == pytest.approx([111.3195, 0, 0], abs=2e-3)
    assert FleetFrame(45.0, 7.0, 100.0).to_enu(45.0, 7.0, 130.0) == pytest.approx([0, 0, 30], abs=1e-6)


@given(frames, points)
def test_geodetic_round_trip(frame: FleetFrame, enu: tuple[float, float, float]) -> None:
    latitude, longitude, altitude = frame.to_geodetic(enu)
    assert abs(latitude) <= 90
    assert abs(longitude) <= 180
    assert frame.to_enu(latitude, longitude, altitude) == pytest.approx(enu, abs=2e-6)


@pytest.mark.parametrize("latitude", [89.9999, -90.0, 90.0, 30.0])
def test_geodetic_round_trip_where_the_iteration_does_not_settle(latitude: float) -> None:
    frame = FleetFrame(latitude, 20.0, 50.0)
    for enu in ((100.0, -200.0, 10.0), (3e5, 4e5, 10.0), (-7e5, 9e5, -3e3)):
        back = frame.to_geodetic(enu)
        assert abs(back[0]) <= 90
        assert frame.to_enu(*back) == pytest.approx(enu, abs=1e-4)


def test_the_step_of_the_wire_is_a_centimetre() -> None:
    frame = FleetFrame(47.0, 8.0, 400.0)
    latitude, longitude, altitude = frame.to_geodetic((120.0, -80.0, 30.0))
    rounded = frame.to_enu(round(latitude * 1e7) / 1e7, round(longitude * 1e7) / 1e7, round(altitude, 3))
    assert np.linalg.norm(rounded - (120.0, -80.0, 30.0)) < 0.01


@given(frames, offsets, offsets, st.floats(-200, 200), points)
def test_a_local_frame_is_rigid_and_agrees_with_the_globe(
    fleet: FleetFrame, north: float, east: float, up: float, ned: tuple[float, float, float]
) -> None:
    origin = fleet.latitude + north, fleet.longitude + east, fleet.altitude + up
    local = fleet.local(*origin)
    R = local.rotation
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(R) == pytest.approx(1)
    through_globe = fleet.to_enu(*FleetFrame(*origin).to_geodetic(ned_to_enu(ned)))
    assert local.position_to_fleet(ned) == pytest.approx(through_globe, abs=1e-4)
    assert local.position_to_local(local.position_to_fleet(ned)) == pytest.approx(ned, abs=1e-7)
    assert local.velocity_to_local(local.velocity_to_fleet(ned)) == pytest.approx(ned, abs=1e-9)
    moved = local.position_to_fleet(ned) - local.position_to_fleet((0, 0, 0))
    assert local.velocity_to_fleet(ned) == pytest.approx(moved, abs=1e-7)


@given(frames, offsets, offsets, angles)
def test_yaw_turns_with_the_local_frame(fleet: FleetFrame, north: float, east: float, yaw: float) -> None:
    local = fleet.local(fleet.latitude + north, fleet.longitude + east, fleet.altitude)
    in_fleet = local.yaw_to_fleet(yaw)
    assert math.remainder(local.yaw_to_local(in_fleet) - yaw, math.tau) == pytest.approx(0, abs=1e-12)
    ahead = local.velocity_to_fleet((math.cos(yaw), math.sin(yaw), 0.0))
    drawn = math.atan2(ahead[1], ahead[0])
    # Between planes tilted by τ the drawn angle differs by up to τ²/4; two kilometres of 5 are 5 µrad.
    assert math.remainder(drawn - in_fleet, math.tau) == pytest.approx(0, abs=1e-5)


def test_a_vehicle_at_the_fleet_origin_has_the_fleet_frame_in_ned() -> None:
    local = FleetFrame(47.0, 8.0, 400.0).local(47.0, 8.0, 400.0)
    assert local.position_to_fleet((1.0, 2.0, 3.0)) == pytest.approx([2.0, 1.0, -3.0])
    assert local.yaw_to_local(0.0) == pytest.approx(math.pi / 2)
    many = np.arange(24.0).reshape(2, 4, 3)
    assert local.position_to_local(local.position_to_fleet(many)) == pytest.approx(many)


def test_the_turn_between_meridians_has_the_right_sense() -> None:
    """East of the origin in the northern hemisphere, own north leans to the fleet's west: its ENU yaw exceeds
    90°."""
    local = FleetFrame(60.0, 8.0, 0.0).local(60.0, 8.1, 0.0)
    assert local.yaw_to_fleet(0.0) - math.pi / 2 == pytest.approx(
        math.radians(0.1) * math.sin(math.radians(60.0)), rel=1e-3
    )


@given(frames)
def test_checksum_is_that_of_the_origin_on_the_wire_and_the_fingerprint_a_byte_of_it(
    frame: FleetFrame,
) -> None:
    assert 0 <= frame.checksum < 2**32
    assert frame.fingerprint == frame.checksum % 256
    degrees = (round(angle * 1e7) / 1e7 for angle in (frame.latitude, frame.longitude))
    same = FleetFrame(*degrees, round(frame.altitude * 1e3) / 1e3)
    assert same.checksum == frame.checksum


def test_checksums_of_neighbouring_origins_differ_and_fingerprints_mostly() -> None:
    """Along a line of 4 m that goes north, and up by as many mm."""
    moved = [FleetFrame(47.0 + step * 1e-7, 8.0, 400.0) for step in range(400)]
    moved += [FleetFrame(47.0, 8.0, 400.0 + 1e-3 * step) for step in range(1, 400)]
    assert len({frame.checksum for frame in moved}) == len(moved)
    assert len({frame.fingerprint for frame in moved[:64]}) > 50
