"""A node of a real-time flight behind its impaired links: whose light reaches its camera."""

from __future__ import annotations

from collections.abc import Sequence

from mavlink_bridge.messages import HilState, Source
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec
from outrider.realtime.spawn import rough
from outrider.runs import names
from outrider.simulation.fleet import Fleet
from outrider.simulation.sight import DELAY_US
from tests.outrider.shipped import FIREFLY, LOGS, scenario

POST = {"kind": "post", "radius": 0.4, "speed": 1.0, "through": [[3.0, 2.0], [2.0, 3.0], [1.0, 2.5]]}


class Kept:
    """Node in the place of the first autopilot, which keeps what it receives."""

    name = names.autopilot(11)

    def __init__(self) -> None:
        self.inbox: list[Datagram] = []

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        self.inbox += inbox
        return []


def test_light_comes_from_target_obstacles_and_other_vehicles_and_nobody_else() -> None:
    fleet = Fleet(scenario("walk", vehicles=3, moving=[POST], camera={}), FIREFLY, 1, LOGS)
    node = Kept()
    link = rough(fleet, node, {"autopilot": names.companion(11), "sight": None})
    codec = Codec()

    def light(system: int) -> Datagram:
        truth = HilState(Source(system, 1), 0, 47.0, 8.0, 400.0, (0.0, 0.0, 0.0))
        return Datagram("sight", codec.encode(truth))

    # A multicast group returns the own messages, too; 77 is nobody.
    link.step(0, [light(system) for system in (fleet.target_system, 11, 12, 13, 190, 77)])
    link.step(DELAY_US - 1, [])
    assert node.inbox == []
    link.step(DELAY_US, [])
    found = [message.source.system for one in node.inbox for message in Codec().feed(one.data)]
    assert sorted(found) == sorted([fleet.target_system, 12, 13, 190])
    assert link.network.counters[:3] == (0, 0, 0)
