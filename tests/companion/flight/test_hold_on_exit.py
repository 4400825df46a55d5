"""Laws of the last word: it asks for a hover where our set-points steered, nobody else is told anything, and
it believes the heartbeat alone."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink

from companion.flight.autopilots import Profile
from companion.flight.autopilots.ardupilot import ARDUPILOT
from companion.flight.autopilots.px4 import PX4
from companion.flight.hold_on_exit import HoldOnExit
from mavlink_bridge.messages import CommandAck, CommandLong, Heartbeat, Source
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec

VEHICLE = Source(4, 1)
HELD = {"ArduPilot": 17, "PX4": 4 << 16 | 3 << 24}
OTHER = {"ArduPilot": 5, "PX4": 3 << 16}
PROFILES = [ARDUPILOT, PX4]


def beat(profile: Profile, mode: int | None = None, *, armed: bool = True) -> Heartbeat:
    custom = profile.guided_custom_mode if mode is None else mode
    return Heartbeat(VEHICLE, 2, profile.autopilot, mavlink.MAV_MODE_FLAG_SAFETY_ARMED * armed, custom, 4)


class Talk:
    """A last word of 10 ms steps, and what is said to it."""

    def __init__(self, heartbeat: Heartbeat | None, *, steered: bool = True) -> None:
        self.node = HoldOnExit(4, heartbeat, steered=steered)
        self.now = 1_000_000
        self._codec, self._ear = Codec(), Codec()

    def step(self, *messages: Heartbeat | CommandAck, count: int = 1) -> list[CommandLong]:
        inbox = [Datagram("autopilot", self._codec.encode(message)) for message in messages]
        orders = []
        for _ in range(count):
            for datagram in self.node.step(self.now, inbox):
                orders += [m for m in self._ear.feed(datagram.data) if isinstance(m, CommandLong)]
            inbox = []
            self.now += 10_000
        return orders


@pytest.mark.parametrize("profile", PROFILES, ids=lambda p: p.name)
def test_it_holds_when_the_heartbeat_says_so_whatever_was_acknowledged(profile):
    talk = Talk(beat(profile))
    assert talk.step()
    # Somebody else's, or of a mode that is not there yet.
    orders = talk.step(CommandAck(VEHICLE, mavlink.MAV_CMD_DO_SET_MODE, 0, 0, 0, 4, 195), count=50)
    assert not talk.node.over
    assert not orders
    assert talk.step(beat(profile, HELD[profile.name])) == []
    assert talk.node.said == f"holds ({profile.hold_name})"
    assert not talk.node.failed


@pytest.mark.parametrize("profile", PROFILES, ids=lambda p: p.name)
@pytest.mark.parametrize("answer", [None, 0, 2, 4])
def test_who_goes_on_along_the_set_points_is_a_failure(profile, answer):
    talk = Talk(beat(profile))
    asked = 0
    for second in range(4):
        said = [beat(profile)]
        if answer is not None:
            said.append(CommandAck(VEHICLE, mavlink.MAV_CMD_DO_SET_MODE, answer, 0, 0, 4, 195))
        asked += len(talk.step(*said, count=100))
        assert talk.node.over == (second == 3)
    assert asked >= 2
    assert talk.node.failed
    assert talk.node.said == f"did not take {profile.hold_name}"


@given(
    profile=st.sampled_from(PROFILES),
    mode=st.sampled_from(["guided", "held", "other"]),
    armed=st.booleans(),
    steered=st.booleans(),
)
def test_nobody_elses_vehicle_is_told_anything(profile, mode, armed, steered):
    """A ground station may fly it in the same mode."""
    custom = {"guided": None, "held": HELD[profile.name], "other": OTHER[profile.name]}[mode]
    talk = Talk(beat(profile, custom, armed=armed), steered=steered)
    orders = talk.step(beat(profile, custom, armed=armed), count=5)
    assert bool(orders) == (steered and armed and mode == "guided")
    assert talk.node.over == (not orders)
    assert not talk.node.failed


@pytest.mark.parametrize("profile", PROFILES, ids=lambda p: p.name)
def test_who_takes_it_over_meanwhile_keeps_it(profile):
    talk = Talk(beat(profile))
    assert talk.step()
    assert talk.step(beat(profile, OTHER[profile.name]), count=100) == []
    assert talk.node.said == "not ours"


def test_it_may_have_armed_a_moment_ago():
    """Heartbeats come once a second."""
    talk = Talk(beat(ARDUPILOT, armed=False))
    assert talk.step(count=50) == []
    assert not talk.node.over
    assert talk.step(beat(ARDUPILOT))


def test_who_was_never_heard_is_told_nothing():
    assert Talk(None).node.over
