"""A fleet on the ground with the check beside each vehicle, in lock-step."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from companion.config import CompanionConfig
from mavlink_bridge.clocks.node_clock import NodeClock
from mavlink_bridge.clocks.system_clock import SystemTimeReading
from mavlink_bridge.loops.lockstep import LockStep, Scheduled
from mavlink_bridge.network.channel import Channel, Direction, Faults
from mavlink_bridge.network.simulated import SimulatedNetwork
from mavlink_bridge.node import Node
from outrider.preflight.findings import Check, Result, Verdict
from outrider.preflight.node import Preflight
from outrider.preflight.terms import FlightTerms, Terms
from outrider.preflight.tube import TrackingError
from outrider.scenarios.fly_config import FleetOrigin
from sitl.node import LINK, Autopilot
from tests.outrider.doctor.bench import autopilot
from tests.sitl.autopilot_rig import SITE

PERIOD, TICK = 10_000, 2_000
SECOND = 1_000_000
BEGIN = 1_700_000_000 * SECOND
"""Reading of all clocks at the start, µs."""
ORIGIN = FleetOrigin(latitude=SITE.latitude, longitude=SITE.longitude, altitude=SITE.altitude)
CONFIG: dict[str, Any] = {
    "certified": {"fleet": [1, 2, 3]},
    "limits": {"v_max": [3.0, 3.0, 1.0], "u_max": [2.0, 2.0, 2.0]},
}


def companion(**changes: Any) -> CompanionConfig:
    """The settings, with the parts of ``changes`` merged into theirs."""
    document = {name: dict(part) for name, part in CONFIG.items()}
    for name, part in changes.items():
        document[name] = {**document.get(name, {}), **part} if isinstance(part, dict) else part
    return CompanionConfig.model_validate(document)


SWIFT = Faults(delay=4_000)


class Fleet:
    """Three vehicles, all ArduPilot but the second; ``configs``, ``origins``, ``autopilots``: what differs of
    one, by system id. ``fly``: terms of the flights alone; ``others``: further
    nodes on the cables of the autopilots.
    ``twins``: ids of which a second companion runs. ``faults``: of the swarm's channel."""

    def __init__(
        self,
        faults: Faults = SWIFT,
        *,
        overrides: Mapping[Direction, Faults] | None = None,
        configs: Mapping[int, CompanionConfig] | None = None,
        origins: Mapping[int, FleetOrigin] | None = None,
        autopilots: Mapping[int, Mapping[str, Any]] | None = None,
        ahead: Mapping[int, int] | None = None,
        present: tuple[int, ...] = (1, 2, 3),
        twins: tuple[int, ...] = (),
        system_us: int | None = None,
        flown: Mapping[int, TrackingError] | None = None,
        fly: Mapping[int, FlightTerms] | None = None,
        others: Mapping[int, Node] | None = None,
        wait_s: float = 20.0,
        seed: int = 1,
    ) -> None:
        configs, origins = configs or {}, origins or {}
        self.nodes: dict[str, Preflight] = {}
        self.autopilots: dict[int, Autopilot] = {}
        scheduled, channels, swarm = [], [], {}
        for system in present:
            flavour = "px4" if system == 2 else "ardupilot"
            vehicle = autopilot(flavour, system, seed, **(autopilots or {}).get(system, {}))
            self.autopilots[system] = vehicle
            scheduled.append(Scheduled(vehicle, 20_000))
            members = {vehicle.name: LINK}
            for twin in range(1 + (system in twins)):
                terms = Terms(
                    system,
                    configs.get(system, companion()),
                    origins.get(system, ORIGIN),
                    5.0,
                    wait_s,
                    run=1000 * twin + system,
                    flown=(flown or {}).get(system),
                    fly=(fly or {}).get(system),
                )
                bound = system_us
                clock = None if bound is None else _clock(bound)
                node = Preflight(terms, None, clock)
                node.name += "'" * twin
                self.nodes[node.name] = node
                shown = NodeClock(BEGIN + (ahead or {}).get(system, 0))
                scheduled.append(Scheduled(node, PERIOD, 2 * TICK * (1 + system + twin), shown))
                members[node.name] = "autopilot"
                swarm[node.name] = "swarm"
            if others and system in others:
                scheduled.append(Scheduled(others[system], PERIOD))
                members[others[system].name] = LINK
            channels.append(Channel(f"cable-{system}", members, Faults(delay=2_000)))
        channels.append(Channel("swarm", swarm, faults, overrides or {}))
        self.loop = LockStep(scheduled, SimulatedNetwork(channels, seed, TICK), TICK)

    def run(self, seconds: float = 120.0) -> dict[str, Verdict]:
        """Until all are over; the verdict of each, by name."""
        self.loop.run(round(seconds * SECOND), lambda _: all(one.over for one in self.nodes.values()))
        return {name: node.verdict() for name, node in self.nodes.items()}


def _clock(bound: int) -> Any:
    return lambda now: SystemTimeReading(0, bound)


def failed(verdict: Verdict) -> set[tuple[str, str]]:
    """Subjects and names of the checks that fail."""
    return {(check.subject, check.name) for check in verdict.checks if check.result is Result.FAIL}


def found(verdict: Verdict, subject: str, name: str) -> Check:
    """The one check of that subject and name."""
    (check,) = [one for one in verdict.checks if (one.subject, one.name) == (subject, name)]
    return check
