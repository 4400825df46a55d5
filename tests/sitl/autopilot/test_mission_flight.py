"""A mission that was sent up is flown: its places in their order, its pauses, its end."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as dialect

from tests.sitl.autopilot_rig import ARM, FLAVOURS, GUIDED, SET_MODE, Rig
from tests.sitl.mission_client import (
    DELAY,
    JUMP,
    LAND,
    LOITER_TIME,
    LOITER_UNLIM,
    MISSION_FRAME,
    RTL,
    SPEED,
    TAKEOFF,
    WAYPOINT,
    Way,
    at,
    upload,
)
from tests.sitl.outside_client import Client

AUTO = {"ardupilot": (1, 3), "px4": (1, 4, 4)}
RETURN = {"ardupilot": (1, 6), "px4": (1, 4, 5)}
HOME = Way(WAYPOINT)
START = 300


def plan_for(flavour: str, *ways: Way) -> list[Way]:
    """ArduPilot keeps home as item 0."""
    return [HOME, *ways] if flavour == "ardupilot" else list(ways)


def ready(flavour: str, *ways: Way, **settings: object) -> Client:
    client = Client(Rig(flavour, tick=10_000, **settings))
    client.wait(1.2)
    assert upload(client, plan_for(flavour, *ways)) == 0
    return client


def take_off_by_mission(client: Client) -> None:
    if client.rig.flavour == "ardupilot":
        assert client.command(SET_MODE, *GUIDED["ardupilot"]) == 0
        assert client.command(ARM, 1) == 0
        assert client.command(SET_MODE, *AUTO["ardupilot"]) == 0
    else:
        assert client.command(SET_MODE, *AUTO["px4"]) == 0
        assert client.command(ARM, 1) == 0


def fly(client: Client, seconds: float) -> np.ndarray:
    """The true path (n, 3), NED."""
    track = []
    for _ in range(round(seconds * 1e6 / client.rig.tick)):
        client.wait(client.rig.tick * 1e-6)
        track.append(client.rig.position.copy())
    return np.array(track)


def passes(track: np.ndarray, *places: tuple[float, float, float], within: float = 2.2) -> list[int]:
    """When each place is first near, each after the one before."""
    start, times = 0, []
    for place in places:
        near = np.linalg.norm(track[start:] - place, axis=1) <= within
        assert near.any(), f"never at {place} after {start}"
        start += int(np.argmax(near))
        times.append(start)
    return times


def reached(client: Client) -> list[int]:
    return [m.seq for m in client.of("MISSION_ITEM_REACHED")]


def mode(client: Client) -> tuple[int, ...]:
    client.wait(1.1)
    custom = client.of("HEARTBEAT")[-1].custom_mode
    return (1, custom) if client.rig.flavour == "ardupilot" else (1, custom >> 16 & 0xFF, custom >> 24)


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_square_with_a_landing(flavour):
    client = ready(
        flavour,
        at(0, 0, 6, TAKEOFF),
        at(12, 0, 6),
        at(12, 10, 9),
        at(0, 10, 6),
        at(0, 3, 0, LAND),
    )
    take_off_by_mission(client)
    track = fly(client, 45.0)
    passes(track, (0, 0, -6), (12, 0, -6), (12, 10, -9), (0, 10, -6), (0, 3, 0))
    first = 1 if flavour == "ardupilot" else 0
    assert reached(client) == list(range(first, first + 5))
    assert not client.rig.autopilot.armed
    np.testing.assert_allclose(client.rig.position, (0, 3, 0), atol=0.4)
    client.send(dialect.MAVLink_command_long_message(11, 1, 512, 0, 42, 0, 0, 0, 0, 0, 0))
    assert client.of("MISSION_CURRENT")[-1].mission_state == 5


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_it_flies_no_faster_than_it_may(flavour):
    speed = Way(SPEED, params=(1.0, 2.0, -1.0, 0.0), frame=MISSION_FRAME)
    client = ready(flavour, at(0, 0, 5, TAKEOFF), at(20, 0, 5), speed, at(20, 20, 5), at(20, 20, 15))
    take_off_by_mission(client)
    track = fly(client, 38.0)
    corner, second, top = passes(track, (20, 0, -5), (20, 20, -5), (20, 20, -15))
    velocity = np.diff(track, axis=0) / (client.rig.tick * 1e-6)
    speeds = np.linalg.norm(velocity, axis=1)
    assert 4.5 < speeds[:corner].max() < 5.3
    assert 1.8 < speeds[corner + 300 : second].max() < 2.2
    assert -velocity[second:top, 2].min() < 2.6


@pytest.mark.parametrize("flavour", FLAVOURS)
@pytest.mark.parametrize(
    "pause",
    [
        at(10, 0, 5, LOITER_TIME, 4.0),
        at(10, 0, 5, WAYPOINT, 4.0),
        Way(DELAY, params=(4.0, 0.0, 0.0, 0.0), frame=2),
    ],
)
def test_it_waits_as_long_as_it_is_told(flavour, pause):
    client = ready(flavour, at(0, 0, 5, TAKEOFF), at(10, 0, 5), pause, at(10, 8, 5))
    take_off_by_mission(client)
    times = {}
    for _ in range(3000):
        for m in client.wait(client.rig.tick * 1e-6):
            if m.get_type() == "MISSION_ITEM_REACHED":
                times[m.seq] = client.rig.now
    first = 1 if flavour == "ardupilot" else 0
    assert times[first + 2] - times[first + 1] == pytest.approx(4e6, abs=1e5)


def test_a_radius_of_its_own_counts_with_px4():
    """The larger one lets it turn off earlier."""
    turned = []
    for radius in (0.5, 6.0):
        client = ready("px4", at(0, 0, 5, TAKEOFF), at(15, 0, 5, WAYPOINT, 0.0, radius), at(15, 15, 5))
        take_off_by_mission(client)
        track = fly(client, 25.0)
        turned.append(track[track[:, 1] > 1.0][0, 0])
    assert turned[0] > 14.0
    assert turned[1] < 13.0


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_loiter_without_end_has_none(flavour):
    client = ready(flavour, at(0, 0, 5, TAKEOFF), at(8, 0, 5, LOITER_UNLIM), at(20, 0, 5))
    take_off_by_mission(client)
    fly(client, 60.0)
    np.testing.assert_allclose(client.rig.position, (8, 0, -5), atol=0.3)
    assert mode(client) == AUTO[flavour]


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_jumps_go_round_as_often_as_they_say(flavour):
    first = 1 if flavour == "ardupilot" else 0
    jump = Way(JUMP, params=(first + 1.0, 2.0, 0.0, 0.0), frame=MISSION_FRAME)
    client = ready(flavour, at(0, 0, 5, TAKEOFF), at(8, 0, 5), at(8, 8, 5), jump, at(0, 8, 5))
    take_off_by_mission(client)
    fly(client, 60.0)
    there, back = first + 1, first + 2
    assert reached(client) == [first, there, back, there, back, there, back, first + 4]


def test_a_plan_of_jumps_alone_ends():
    jump = Way(JUMP, params=(1.0, -1.0, 0.0, 0.0), frame=MISSION_FRAME)
    client = ready("px4", jump, jump)
    take_off_by_mission(client)
    client.wait(1.0)
    assert mode(client) == (1, 4, 3)


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_return_in_a_mission_climbs_goes_home_and_lands(flavour):
    client = ready(
        flavour, at(0, 0, 5, TAKEOFF), at(15, 0, 5), Way(RTL, frame=MISSION_FRAME), return_height=9.0
    )
    take_off_by_mission(client)
    track = fly(client, 50.0)
    passes(track, (15, 0, -5), (15, 0, -9), (0, 0, -9), (0, 0, 0), within=2.1)
    assert not client.rig.autopilot.armed
    np.testing.assert_allclose(client.rig.position[:2], (0, 0), atol=0.5)


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_return_by_mode_and_by_command_goes_to_where_home_was_set(flavour):
    for order in ((SET_MODE, *RETURN[flavour]), (20,)):
        client = Client(Rig(flavour, tick=10_000).hover(5.0))
        home = at(6, 4, 0)
        found = client.send(
            dialect.MAVLink_command_int_message(11, 1, 0, 179, 0, 0, 0, 0, 0, 0, home.x, home.y, 488.0)
        )
        assert [m.result for m in found if m.get_type() == "COMMAND_ACK"] == [0]
        assert client.command(*order) == 0
        fly(client, 45.0)
        np.testing.assert_allclose(client.rig.position, (6, 4, 0), atol=0.5)
        assert not client.rig.autopilot.armed


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_pause_and_a_return_to_the_same_item(flavour):
    client = ready(flavour, at(0, 0, 5, TAKEOFF), at(20, 0, 5), at(20, 20, 5))
    take_off_by_mission(client)
    client.wait(9.0)
    hold = (1, 17) if flavour == "ardupilot" else (1, 4, 3)
    assert client.command(SET_MODE, *hold) == 0
    client.wait(6.0)
    stopped = client.rig.position.copy()
    assert 1.0 < stopped[0] < 19.0
    client.wait(2.0)
    np.testing.assert_allclose(client.rig.position, stopped, atol=0.05)
    assert client.command(SET_MODE, *AUTO[flavour]) == 0
    track = fly(client, 20.0)
    passes(track, (20, 0, -5), (20, 20, -5))


@pytest.mark.parametrize("flavour", FLAVOURS)
@pytest.mark.parametrize("by_command", [True, False])
def test_another_item_can_be_made_the_current_one(flavour, by_command):
    client = ready(flavour, at(0, 0, 5, TAKEOFF), at(20, 0, 5), at(0, 12, 5))
    take_off_by_mission(client)
    client.wait(6.0)
    last = len(client.rig.autopilot.saved.plans[0]) - 1
    if by_command:
        assert client.command(224, last) == 0
        # A refused command has no effect: parameter 2 would return the mission to its first item.
        assert client.command(224, 99, 1) == 2
    else:
        found = client.send(dialect.MAVLink_mission_set_current_message(11, 1, last))
        assert [m.seq for m in found if m.get_type() == "MISSION_CURRENT"] == [last]
    track = fly(client, 12.0)
    assert track[:, 0].max() < 15.0
    passes(track, (0, 12, -5))


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_when_all_is_done_it_stays_there(flavour):
    client = ready(flavour, at(0, 0, 5, TAKEOFF), at(9, 0, 5))
    take_off_by_mission(client)
    fly(client, 20.0)
    np.testing.assert_allclose(client.rig.position[:2], (9, 0), atol=2.1)
    assert mode(client) == ((1, 3) if flavour == "ardupilot" else (1, 4, 3))
    assert "Mission finished" in client.texts
    assert client.rig.speed < 0.05


def test_px4_takes_off_without_a_takeoff_item_and_starts_by_command():
    client = ready("px4", at(10, 0, 8), Way(RTL, frame=MISSION_FRAME), takeoff_height=3.0)
    assert client.command(START) == 0
    assert client.rig.autopilot.armed
    track = fly(client, 15.0)
    up, _ = passes(track, (0, 0, -3), (10, 0, -8), within=2.1)
    assert np.abs(track[:up, :2]).max() < 0.3


def test_ardupilot_wants_a_takeoff_first_and_a_mission_at_all():
    client = Client(Rig("ardupilot", tick=10_000))
    client.wait(1.2)
    assert client.command(SET_MODE, *AUTO["ardupilot"]) == 4
    upload(client, [HOME, at(5, 0, 5)])
    client.command(SET_MODE, 1, 4)
    client.command(ARM, 1)
    assert client.command(SET_MODE, *AUTO["ardupilot"]) == 4
    assert client.texts[-1] == "Auto: Missing Takeoff Cmd"


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_it_looks_where_it_flies(flavour):
    client = ready(flavour, at(0, 0, 5, TAKEOFF), at(0, 15, 5), at(-15, 15, 5))
    take_off_by_mission(client)
    headings = {}
    for _ in range(2500):
        for m in client.wait(client.rig.tick * 1e-6):
            if m.get_type() == "MISSION_ITEM_REACHED":
                headings[m.seq] = client.of("ATTITUDE")[-1].yaw
    first = 1 if flavour == "ardupilot" else 0
    assert headings[first + 1] == pytest.approx(math.pi / 2, abs=0.1)
    assert abs(headings[first + 2]) == pytest.approx(math.pi, abs=0.15)


def test_the_same_mission_twice_is_the_same_to_the_bit():
    flights = []
    for _ in range(2):
        client = ready("px4", at(0, 0, 5, TAKEOFF), at(9, 4, 7), Way(RTL, frame=MISSION_FRAME))
        take_off_by_mission(client)
        client.wait(10.0)
        flights.append(client.rig.bytes)
    assert flights[0] == flights[1]


def test_a_new_mission_in_flight_begins_at_its_beginning_with_px4():
    client = ready("px4", at(0, 0, 5, TAKEOFF), at(30, 0, 5))
    take_off_by_mission(client)
    client.wait(6.0)
    assert upload(client, [at(0, 9, 5), at(-9, 9, 5)]) == 0
    track = fly(client, 16.0)
    passes(track, (0, 9, -5), (-9, 9, -5))


def test_a_new_mission_in_flight_goes_on_where_the_old_one_was_with_ardupilot():
    rig = Rig("ardupilot").hover(5.0)
    client = Client(rig)
    assert upload(client, [at(0, 0, 0), at(9, 0, 5), at(40, 0, 5)]) == 0
    assert client.command(SET_MODE, *AUTO["ardupilot"]) == 0
    client.wait(8.0)
    # On its way to the second item, which is now elsewhere; the first it does not fly again.
    assert rig.position[0] > 9.0
    assert upload(client, [at(0, 0, 0), at(0, -30, 5), at(9, 9, 5)]) == 0
    track = fly(client, 12.0)
    assert np.linalg.norm(track[-1] - (9.0, 9.0, -5.0)) < 2.5
    assert track[:, 1].min() > -1.0


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_takeoff_item_in_the_air_leads_up_or_nowhere(flavour):
    home = [at(0, 0, 0)] if flavour == "ardupilot" else []
    rig = Rig(flavour).hover(12.0)
    client = Client(rig)
    assert upload(client, [*home, at(0, 0, 5, TAKEOFF), at(6, 0, 12)]) == 0
    assert client.command(SET_MODE, *AUTO[flavour]) == 0
    lowest = 12.0
    for _ in range(100):
        client.wait(0.1)
        lowest = min(lowest, -rig.position[2])
    assert lowest > 11.5
