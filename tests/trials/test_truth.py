"""The true states of real firmware's simulations: asked for until they come, each of its own kind."""

from __future__ import annotations

import select
import socket

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.clocks.clock import SimulatedClock
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.links.endpoints import UdpIn
from mavlink_bridge.messages import CommandLong, Heartbeat, HilState, SimulationState, Source
from mavlink_bridge.wire.codec import Codec
from outrider.errors import InputError
from trials.receivers import PortReceiver
from trials.truth import TruthObserver

FLEET = FleetFrame(47.397742, 8.545594, 488.0)


class Wire:
    """An ear to one or more vehicles, in memory."""

    def __init__(self) -> None:
        self.coming: list[bytes] = []
        self.told: list[tuple[int, bytes]] = []

    def receive(self) -> list[bytes]:
        found, self.coming = self.coming, []
        return found

    def tell(self, system: int, data: bytes) -> None:
        self.told.append((system, data))

    def fileno(self) -> None:
        """None: it is polled."""

    def close(self) -> None:
        pass

    def commands(self) -> dict[int, tuple[int, float, float]]:
        """The last of each vehicle: command, message, interval."""
        found = {}
        for system, data in self.told:
            for message in Codec().feed(data):
                if isinstance(message, CommandLong):
                    assert message.target_system == system
                    found[system] = (message.command, *message.params[:2])
        return found


@pytest.fixture
def rig():
    wires = {1: Wire(), 2: Wire()}
    clock = SimulatedClock(10_000_000)
    observer = TruthObserver(wires, {1: "ardupilot", 2: "px4"}, FLEET, clock)
    return observer, wires, clock


def beat(system, armed):
    return Codec().encode(
        Heartbeat(Source(system, 1), 2, 3, mavlink.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0, 0, 4)
    )


def state(system, east, armed=True):
    place = FLEET.to_geodetic((east, 0.0, 5.0))
    kinds = {
        1: SimulationState(Source(1, 1), *place, (0.0, 0.0, 0.0)),
        2: HilState(Source(2, 1), 7, *place, (0.0,) * 3),
    }
    return Codec().encode(kinds[system])


def test_each_is_asked_for_what_its_firmware_tells_until_it_does(rig) -> None:
    observer, wires, clock = rig
    observer.turn()
    assert wires[1].commands() == {1: (511, 108.0, 20_000.0)}
    assert wires[2].commands() == {2: (511, 115.0, 20_000.0)}
    assert not observer.ready
    assert "SIM_STATE of vehicle 1" in observer.wanted
    assert "HIL_STATE_QUATERNION of vehicle 2" in observer.wanted
    for system, wire in wires.items():
        wire.coming += [beat(system, True), state(system, 5.0)]
        wire.told.clear()
    clock.wait_until(20_600_000)
    observer.turn()
    assert observer.ready
    assert not any(wire.commands() for wire in wires.values())
    clock.wait_until(clock.now() + 2_000_000)
    observer.turn()
    assert set(wires[1].commands()) == {1}


def test_tracks_are_by_the_time_of_the_wall_and_know_who_is_armed(rig) -> None:
    observer, wires, clock = rig
    for step in range(5):
        wires[1].coming += [beat(1, step >= 2), state(1, 0.1 * step)]
        wires[2].coming += [beat(2, False), state(2, 5.0)]
        observer.turn()
        clock.wait_until(clock.now() + 100_000)
    assert observer.place(1) == pytest.approx([0.4, 0.0, 5.0], abs=0.02)
    tracks = observer.tracks()
    assert tracks[1].times == pytest.approx(0.1 * np.arange(5))
    assert tracks[1].places[:, 0] == pytest.approx(0.1 * np.arange(5), abs=0.02)
    assert tracks[1].armed.tolist() == [False, False, True, True, True]
    assert not observer.grounded
    wires[1].coming.append(beat(1, False))
    observer.turn()
    assert observer.grounded
    assert observer.latest == pytest.approx(0.5)
    assert observer.seconds(np.array([10_250_000.0])) == pytest.approx([0.25])


def test_what_others_say_counts_nowhere(rig) -> None:
    observer, wires, _ = rig
    assert observer.tracks() == {}
    assert observer.place(1) is None
    wires[1].coming += [
        beat(9, True),
        Codec().encode(Heartbeat(Source(1, 195), 18, 8, mavlink.MAV_MODE_FLAG_SAFETY_ARMED, 0, 4)),
        b"noise",
    ]
    observer.turn()
    assert all(one.armed is None for one in observer.seen.values())


def test_a_port_tells_each_vehicle_only_what_is_for_it() -> None:
    receiver = PortReceiver(UdpIn("127.0.0.1", 0))
    try:
        ends = {}
        for system in (1, 2):
            ends[system] = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            ends[system].connect(receiver.address)
            ends[system].settimeout(5.0)
            ends[system].send(beat(system, False))
        received: list[bytes] = []
        while len(received) < 2:
            received += receiver.receive()
        ends[1].send(beat(1, False))
        assert select.select([receiver.fileno()], [], [], 5.0)[0]
        receiver.tell(2, b"two")
        receiver.tell(1, b"one")
        receiver.tell(3, b"nobody")
        assert (ends[1].recv(99), ends[2].recv(99)) == (b"one", b"two")
        with pytest.raises(InputError, match="End the ground station"):
            PortReceiver(UdpIn("127.0.0.1", receiver.address[1]))
    finally:
        receiver.close()
        for end in ends.values():
            end.close()
