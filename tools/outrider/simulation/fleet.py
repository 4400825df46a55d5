"""Nodes of a scenario for one seed, and their links.

Only this module constructs both companions and emulated autopilots; they exchange only MAVLink bytes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from companion.backup_node import BackupNode
from companion.config import CompanionConfig
from companion.fleet_time_backup import FleetTimeBackup
from companion.node import Companion
from companion.values.bearings import bearing
from mavlink_bridge.clocks.node_clock import NodeClock
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.network.simulated import Channel, Faults
from mavlink_bridge.node import Node
from outrider.runs import names
from outrider.scenarios.cameras import CameraConfig
from outrider.scenarios.companion_settings import settings_of
from outrider.scenarios.faults import AutopilotClockFault, ClockFault
from outrider.scenarios.links import Links
from outrider.scenarios.scenario import FixedTarget, PathTarget, Scenario
from outrider.scenarios.starts import starts
from outrider.scenarios.streams import Stream, stream
from outrider.simulation import sight
from outrider.simulation.bystander import Bystander
from outrider.simulation.moving import MovingObstacle
from outrider.simulation.operator import Operator
from outrider.simulation.system_clocks import EmulatedSystemClock
from outrider.simulation.targets import Recorded, StandingTarget, Target, Walking
from sitl.camera.scene import Scene
from sitl.config.autopilot import AutopilotConfig
from sitl.node import Autopilot
from sitl.vehicle.config import VehicleConfig


class End(NamedTuple):
    """A node on a link: its name, its name of the link, and the words that denote it in a scenario."""

    node: str
    link: str
    words: tuple[str | int, ...]


class Fleet:
    """Factory of the nodes of ``scenario``; the same seed gives the same nodes, in any process.

    ``logs`` is the folder of recorded targets.
    """

    def __init__(self, scenario: Scenario, vehicle: VehicleConfig, seed: int, logs: Path) -> None:
        self.scenario, self.vehicle, self.seed = scenario, vehicle, seed
        origin = scenario.origin
        self.frame = FleetFrame(origin.latitude, origin.longitude, origin.altitude)
        self.starts = starts(scenario, seed, scenario.companion.planar)
        self.systems = list(scenario.systems)
        self._logs = logs
        target = self.target()
        self.target_system = target.system
        self._facing = target.position(0)

    @property
    def companion_config(self) -> CompanionConfig:
        """The companions' settings, completed from the scenario."""
        return settings_of(self.scenario)

    def companion_config_of(self, k: int) -> CompanionConfig:
        """Return the settings of vehicle ``k``.

        A bystander flies to goals, shares no plan, and avoids neither the target nor obstacles.
        """
        config = self.companion_config
        if k < self.scenario.vehicles:
            return config
        changes: dict[str, object] = {
            "task": "goto",
            "methods": ("baseline",),
            "avoidance": "field",
            "shares_plan": False,
            "target_d_min": None,
            "target_d_safe": None,
            "obstacles": (),
            "moving": (),
        }
        speed = self.scenario.bystanders[k - self.scenario.vehicles].speed
        if speed is not None:
            changes["limits"] = config.limits.model_copy(update={"v_max": (speed,) * 3, "v_min": None})
        return config.model_copy(update=changes)

    def target(self) -> Target:
        """Return the target's node."""
        config = self.scenario.target
        if isinstance(config, FixedTarget):
            return StandingTarget(config, self.frame)
        if isinstance(config, PathTarget):
            return Walking(config, self.frame)
        return Recorded(config, self._logs / config.log, self.frame)

    def moving(self) -> list[MovingObstacle]:
        """Return the nodes of the moving obstacles."""
        scenario = self.scenario
        pairs = zip(scenario.moving, scenario.moving_systems, strict=True)
        return [MovingObstacle(config, system, self.frame) for config, system in pairs]

    def operator(self) -> Operator:
        """Return the operator's node."""
        return Operator(self.frame)

    def companion(self, k: int, stopwatch: Callable[[], int], since: int) -> Companion:
        """Return the companion of vehicle ``k``; ``stopwatch`` (ns) measures its planning.

        ``since`` (µs): true time from which on its clock is that of ``clock``.
        """
        kind = Companion if k < self.scenario.vehicles else Bystander
        config = self.companion_config_of(k)
        return kind(
            config,
            self.systems[k],
            self.target_system,
            self.frame,
            stopwatch,
            system_clock=self.system_clock(k, since),
        )

    @property
    def with_backup(self) -> list[int]:
        """Indices of the vehicles with a backup node: with certified avoidance all but the bystanders."""
        certified = self.scenario.companion.avoidance == "certified"
        return list(range(self.scenario.vehicles)) if certified else []

    def backup_of(self, k: int) -> BackupNode | FleetTimeBackup:
        """Return the backup node of vehicle ``k``."""
        config, system = self.companion_config_of(k), self.systems[k]
        if config.certified.fleet_time == "own":
            return BackupNode(config, system, self.frame)
        return FleetTimeBackup(system, lambda: BackupNode(config, system, self.frame))

    def autopilot(self, k: int) -> Autopilot:
        """Return the autopilot with vehicle ``k``, on the ground below its start or hovering there."""
        start = self.starts.positions[k]
        place = start * (1.0, 1.0, 0.0)
        latitude, longitude, altitude = self.frame.to_geodetic(place)
        facing = 0.0 if self._facing is None else bearing(place, self._facing)
        clock = self._autopilot_clock(k)
        config = AutopilotConfig(
            system_id=self.systems[k],
            flavour=self.scenario.flavour_of(k),
            latitude=latitude,
            longitude=longitude,
            altitude=altitude,
            yaw=float(np.pi / 2 - facing),
            sensors=self.scenario.sensors,
            physics=self.scenario.physics,
            **self.scenario.autopilot.model_dump(),
            epoch_from_steps=clock.utc and self.companion_config.certified.fleet_time == "measured",
            utc_error_us=round(1000.0 * clock.utc_error_ms),
            clock_drift_ppm=clock.drift_ppm,
            start_height=float(start[2]) if self.scenario.airborne else 0.0,
        )
        vehicle = self.vehicle.model_copy(update={"camera": self.camera_of(k)})
        return Autopilot(
            config, vehicle, self.frame, self.seed, weather=self.scenario.weather, scene=self._scene(k)
        )

    def camera_of(self, k: int) -> CameraConfig | None:
        """Return the camera of vehicle ``k``, None if it has none."""
        scenario = self.scenario
        for one in scenario.cameras:
            if one.vehicle == self.systems[k]:
                return one.camera
        return (scenario.camera or self.vehicle.camera) if k < scenario.vehicles else None

    @property
    def has_cameras(self) -> bool:
        """Whether any vehicle has a camera."""
        return any(self.camera_of(k) is not None for k in range(self.scenario.size))

    def _scene(self, k: int) -> Scene | None:
        """Return what the camera of vehicle ``k`` may see; None if no vehicle has a camera."""
        if not self.has_cameras:
            return None
        scenario, others = self.scenario, set(self.systems) - {self.systems[k]}
        return sight.scene(
            self.target_system, scenario.obstacles, scenario.moving_known, sorted(others), self.vehicle
        )

    def shown(self, target: Target, moving: Sequence[MovingObstacle]) -> list[Node]:
        """Return the nodes of target and obstacles, such that cameras see them if there are any."""
        if not self.has_cameras:
            return [target, *moving]
        obstacles = [sight.Shown(one, one.system, one.position, self.frame) for one in moving]
        return [sight.Shown(target, target.system, target.position, self.frame), *obstacles]

    def _autopilot_clock(self, k: int) -> AutopilotClockFault:
        """Return the errors of the clock of autopilot ``k``: none without such a fault."""
        system = self.systems[k]
        for fault in self.scenario.faults:
            if isinstance(fault, AutopilotClockFault) and fault.vehicle == system:
                return fault
        return AutopilotClockFault(kind="autopilot_clock", vehicle=system)

    def clock(self, k: int, since: int) -> NodeClock:
        """Return the clock of companion ``k`` relative to true time from ``since`` (µs) on."""
        for fault in self.scenario.faults:
            if isinstance(fault, ClockFault) and fault.vehicle == self.systems[k]:
                return NodeClock(-round(1000.0 * fault.late_ms), fault.drift_ppm, since)
        bounds = self.scenario.clocks
        offset, drift = stream(self.seed, Stream.CLOCKS, k).uniform(-1.0, 1.0, 2)
        return NodeClock(round(1000.0 * bounds.offset_ms * offset), float(bounds.drift_ppm * drift), since)

    def system_clock(self, k: int, since: int) -> EmulatedSystemClock | None:
        """Return the system clock of companion ``k``; None if nobody disciplines it."""
        bound = self.scenario.clocks.system_us
        if bound is None:
            return None
        error = stream(self.seed, Stream.SYSTEM_CLOCKS, k).uniform(-1.0, 1.0)
        return EmulatedSystemClock(self.clock(k, since), round(bound * error), bound)

    def phases(self) -> list[int]:
        """Return the phase (µs) of each companion in its period.

        The phases are drawn by seed, so that the companions do not all replan on the same tick.
        """
        timing = self.scenario.timing
        random = stream(self.seed, Stream.PHASES)
        ticks = random.integers(timing.companion_us // timing.base_tick_us, size=len(self.systems))
        return [int(tick) * timing.base_tick_us for tick in ticks]

    def channels(self) -> list[Channel]:
        """Return all links of the fleet with their faults, for the simulated network."""
        links = self.scenario.links
        companions = [(names.companion(system), ("companion", system)) for system in self.systems]
        channels = []
        for k, (system, (name, words)) in enumerate(zip(self.systems, companions, strict=True)):
            ends = {
                "autopilot": End(names.autopilot(system), "autopilot", ("autopilot", system)),
                "target": End(names.TARGET, "target", ("target",)),
                "ground": End(names.OPERATOR, "ground", ("operator",)),
            }
            for link, other in ends.items():
                ends_here = [End(name, link, words), other]
                if link == "autopilot" and k in self.with_backup:
                    ends_here.append(End(names.backup_node(system), link, words))
                channels.append(_channel(f"{link}-{name}", ends_here, getattr(links, link)))
            if k in self.with_backup:
                # Companion and backup node run on the same computer: what they send each other is not lost.
                channels.append(
                    Channel(f"backup-{name}", {name: "swarm", names.backup_node(system): "swarm"}, Faults())
                )
        swarm = [End(name, "swarm", words) for name, words in companions]
        swarm += [End(names.moving(s), "swarm", ("moving", s)) for s in self.scenario.moving_systems]
        channels.append(_channel("swarm", swarm, links.swarm))
        if self.has_cameras:
            bodies = [names.TARGET, *map(names.moving, self.scenario.moving_systems)]
            channels.append(sight.channel([*map(names.autopilot, self.systems), *bodies]))
        return channels


def _channel(name: str, ends: Sequence[End], links: Links) -> Channel:
    """Return a channel between ``ends`` whose paths have the faults that ``links`` defines for them."""
    overrides: dict[tuple[str | None, str | None], Faults] = {}
    if links.directions:
        for sender in ends:
            for receiver in ends:
                faults = links.between(sender.words, receiver.words)
                if sender is not receiver and faults != links.faults:
                    overrides[sender.node, receiver.node] = faults
    return Channel(name, {end.node: end.link for end in ends}, links.faults, overrides=overrides)
