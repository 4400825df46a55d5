"""One lock-step flight of a scenario: compose companions, autopilots, target and operator, take off, give the
goal, watch, land. The only place where companion and sitl stand side by side; they still meet only in MAVLink
bytes."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack
from enum import Enum
from pathlib import Path

import numpy as np

from companion.node import Companion, Tally
from companion.pilot import Phase
from companion.surface import bearing, circle_error
from mavlink_bridge.ether import Channel, Ether, Faults
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.node import Datagram
from mavlink_bridge.runtime import Direction, LockStep, Scheduled
from mavlink_bridge.tlog import TlogWriter
from outrider.operator import Operator
from outrider.scenario import FIRST_SYSTEM, FixedTarget, Links, Scenario
from outrider.starts import starts
from outrider.targets import Recorded, Standing, Target
from outrider.truth import Truth
from sitl.autopilot_config import AutopilotConfig
from sitl.config import VehicleConfig
from sitl.node import Autopilot

EPOCH = 1_767_225_600_000_000
"""Unix µs at which every simulated flight begins (2026-01-01 00:00 UTC): logs then open in any tool."""
LINK_NUMBERS = {"autopilot": 0, "swarm": 1, "target": 2, "ground": 3}
"""Link numbers in the low two bits of a tlog's time stamps."""
NEAR, SLOW, HOLD = 0.3, 0.3, 1_000_000
"""Converged: nearer than this (m), slower than this against the target (m/s), for so long (µs)."""
HOVERING = 0.1
"""m/s; the clock starts when every vehicle is slower."""
_SETTLE, _AFTER, _PREPARE_CAP, _LAND_CAP = 500_000, 5_000_000, 90_000_000, 60_000_000


class Stage(Enum):
    """Where the run is."""

    PREPARE = "take-off"
    CLOCK = "flight"
    LAND = "landing"
    DONE = "done"


class Flight:
    """Builds the nodes of a scenario for one seed, and runs them. ``progress`` hears the stage and simulated
    seconds."""

    def __init__(
        self,
        scenario: Scenario,
        vehicle: VehicleConfig,
        seed: int,
        logs: Path,
        progress: Callable[[Stage, float], None] = lambda _stage, _seconds: None,
        reverse_nodes: bool = False,
        run_directory: Path | None = None,
    ) -> None:
        self.scenario, self.seed = scenario, seed
        self.span = vehicle.span
        self.stage = Stage.PREPARE
        self.clock_start: int | None = None
        self.clock_end: int | None = None
        self.converged_at: int | None = None
        self.failure: str | None = None
        self._progress = progress
        self._reverse = reverse_nodes
        self._directory = run_directory
        origin = scenario.origin
        self.fleet = FleetFrame(origin.latitude, origin.longitude, origin.altitude)
        self.starts = starts(scenario, seed, scenario.companion.planar)
        self.systems = [FIRST_SYSTEM + k for k in range(scenario.vehicles)]
        self.target = self._make_target(logs)
        self.autopilots = [self._make_autopilot(k, vehicle) for k in range(scenario.vehicles)]
        self.companions = [
            Companion(scenario.companion, s, self.target.system, self.fleet, time.thread_time_ns)
            for s in self.systems
        ]
        self.operator = Operator(self.fleet)
        self.truth = Truth(self.autopilots, self.target, scenario.d_min, scenario.d_min_target)
        self.ether = Ether(self._channels(), seed, scenario.timing.base_tick_us)
        self._tally_at_start: list[Tally] = []
        self._tally_at_end: list[Tally] = []
        self._calm_since: int | None = None
        self._near_since: int | None = None
        self._land_at = 0

    def run(self) -> None:
        """Fly to the end. ``failure`` says why if the flight never got to its clock or did not land."""
        with ExitStack() as files:
            taps = []
            if self._directory is not None:
                taps.append(_Recorder(self._directory, self.systems, files))
            loop = LockStep(self._schedule(), self.ether, self.scenario.timing.base_tick_us, taps)
            for k, system in enumerate(self.systems):
                self.operator.take_off(system, float(self.starts.positions[k, 2]))
            loop.run(EPOCH + 10_000_000_000, self._watch)

    @property
    def tallies(self) -> list[tuple[Tally, Tally]]:
        """Per companion: at the start of the clock and at its end."""
        now = [c.tally for c in self.companions]
        return list(zip(self._tally_at_start or now, self._tally_at_end or now, strict=True))

    def errors(self, positions: np.ndarray, target: np.ndarray | None) -> np.ndarray:
        """Distance (K,) of each vehicle from where it should be: its goal, or the surface around
        ``target``."""
        if self.starts.goals is not None:
            return np.asarray(np.linalg.norm(positions - self.starts.goals, axis=1))
        if target is None:
            return np.full(len(positions), np.nan)
        surface = self.scenario.companion.surface
        return circle_error(target, positions, surface.radius, surface.height)

    # Building

    def _make_target(self, logs: Path) -> Target:
        config = self.scenario.target
        if isinstance(config, FixedTarget):
            return Standing(config, self.fleet)
        return Recorded(config, logs / config.log, self.fleet)

    def _make_autopilot(self, k: int, vehicle: VehicleConfig) -> Autopilot:
        place = self.starts.positions[k].copy()
        place[2] = 0.0
        latitude, longitude, altitude = self.fleet.to_geodetic(place)
        target = self.target.position(0)
        facing = 0.0 if target is None else bearing(place, target)
        config = AutopilotConfig(
            system_id=self.systems[k],
            flavour=self.scenario.flavour,
            latitude=latitude,
            longitude=longitude,
            altitude=altitude,
            yaw=float(np.pi / 2 - facing),
        )
        return Autopilot(config, vehicle, self.fleet, self.seed)

    def _channels(self) -> list[Channel]:
        links = self.scenario.links
        companions = [c.name for c in self.companions]
        channels = [
            Channel(
                f"autopilot-{c.name}", {c.name: "autopilot", a.name: "autopilot"}, _faults(links.autopilot)
            )
            for c, a in zip(self.companions, self.autopilots, strict=True)
        ]
        channels += [
            Channel(f"target-{name}", {name: "target", "target": "target"}, _faults(links.target))
            for name in companions
        ]
        channels += [
            Channel(f"ground-{name}", {name: "ground", "operator": "ground"}, _faults(links.ground))
            for name in companions
        ]
        channels.append(Channel("swarm", dict.fromkeys(companions, "swarm"), _faults(links.swarm)))
        return channels

    def _schedule(self) -> list[Scheduled]:
        """Companions never replan on one tick: each has a seeded phase offset within its period."""
        timing = self.scenario.timing
        tick = timing.base_tick_us
        random = np.random.default_rng([self.seed, 1])
        nodes = [Scheduled(a, timing.autopilot_us, EPOCH) for a in self.autopilots]
        for companion in self.companions:
            phase = int(random.integers(timing.companion_us // tick)) * tick
            nodes.append(Scheduled(companion, timing.companion_us, EPOCH + phase))
        nodes.append(Scheduled(self.target, timing.companion_us, EPOCH))
        nodes.append(Scheduled(self.operator, timing.companion_us, EPOCH))
        return nodes[::-1] if self._reverse else nodes

    # Watching

    def _watch(self, now: int) -> bool:
        """After every tick; True ends the run."""
        if not self.truth.see(now):
            return False
        self._progress(self.stage, (now - (self.clock_start or EPOCH)) * 1e-6)
        positions, velocities, target = self.truth.latest()
        if self.stage is Stage.PREPARE:
            self._prepare(now, velocities)
        elif self.stage is Stage.CLOCK:
            self._count(now, positions, velocities, target)
        elif self.stage is Stage.LAND:
            if not any(a.armed for a in self.autopilots):
                self.stage = Stage.DONE
            elif now - self._land_at > _LAND_CAP:
                self.failure = (
                    f"not all vehicles were down {_LAND_CAP // 1_000_000} s after the order to land"
                )
                self.stage = Stage.DONE
        return self.stage is Stage.DONE

    def _prepare(self, now: int, velocities: np.ndarray) -> None:
        up = all(c.pilot.phase is Phase.ESCORT for c in self.companions)
        calm = up and float(np.linalg.norm(velocities, axis=1).max()) < HOVERING
        if not calm:
            self._calm_since = None
            if now - EPOCH > _PREPARE_CAP:
                waiting = [
                    f"{c.name} waits for {c.pilot.waiting_for}"
                    + (f" ({c.pilot.said})" if c.pilot.said else "")
                    for c in self.companions
                    if c.pilot.phase is not Phase.ESCORT
                ]
                self.failure = "; ".join(waiting) or "the vehicles do not come to a hover"
                self._land(now)
            return
        self._calm_since = now if self._calm_since is None else self._calm_since
        if now - self._calm_since < _SETTLE:
            return
        self.stage, self.clock_start = Stage.CLOCK, now
        self._tally_at_start = [c.tally for c in self.companions]
        self.target.begin(now)
        if self.starts.goals is not None:
            for system, goal in zip(self.systems, self.starts.goals, strict=True):
                self.operator.goal(system, goal)

    def _count(
        self, now: int, positions: np.ndarray, velocities: np.ndarray, target: np.ndarray | None
    ) -> None:
        since = now - (self.clock_start or 0)
        if self.scenario.has_goal and self.converged_at is None:
            near = bool((self.errors(positions, target) < NEAR).all())
            if near and bool((np.linalg.norm(velocities, axis=1) < SLOW).all()):
                self._near_since = now if self._near_since is None else self._near_since
                if now - self._near_since >= HOLD:
                    self.converged_at = self._near_since
            else:
                self._near_since = None
        over = since >= self.scenario.duration_s * 1e6
        if self.converged_at is not None:
            over = now >= self.converged_at + HOLD + _AFTER
        if over:
            self.clock_end = now
            self._tally_at_end = [c.tally for c in self.companions]
            self._land(now)

    def _land(self, now: int) -> None:
        self.stage, self._land_at = Stage.LAND, now
        for system in self.systems:
            self.operator.land(system)


class _Recorder:
    """One tlog per vehicle: all that its companion received and sent, at the times at which it handled it."""

    def __init__(self, directory: Path, systems: list[int], files: ExitStack) -> None:
        self._writers = {
            f"companion-{s}": files.enter_context(TlogWriter(directory / f"vehicle-{s}.tlog"))
            for s in systems
        }

    def __call__(self, now: int, node: str, _direction: Direction, datagram: Datagram, /) -> None:
        writer = self._writers.get(node)
        if writer is not None:
            writer.write(now, LINK_NUMBERS[datagram.link], datagram.data)


def _faults(links: Links) -> Faults:
    return Faults(
        round(links.delay_ms * 1000),
        round(links.jitter_ms * 1000),
        links.loss,
        links.duplication,
        links.reordering,
    )
