"""Snapshot of an autopilot for telemetry, read from its parts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import MissionCurrent, Source, Vector
from sitl.autopilot.aircraft import Aircraft
from sitl.autopilot.firmware import Mode
from sitl.autopilot.guidance import Activity
from sitl.config.autopilot import AutopilotConfig
from sitl.telemetry.reports import Flight, Snapshot
from sitl.telemetry.status_reports import version
from sitl.values.setpoints import Setpoint
from sitl.vehicle.airframe import hover_speeds
from sitl.vehicle.config import VehicleConfig
from sitl.vehicle.ground import GRAVITY

# In the air; IDLE (thrust cut) counts as landing because touchdown is imminent.
_LANDED_STATES: Final = {
    Activity.TAKEOFF: mavlink.MAV_LANDED_STATE_TAKEOFF,
    Activity.LAND: mavlink.MAV_LANDED_STATE_LANDING,
    Activity.IDLE: mavlink.MAV_LANDED_STATE_LANDING,
}


class SnapshotReader:
    """Reader that makes snapshots for ``Telemetry``."""

    def __init__(
        self,
        config: AutopilotConfig,
        vehicle: VehicleConfig,
        source: Source,
        aircraft: Aircraft,
        mission: Callable[[], MissionCurrent],
        flight: Flight,
    ) -> None:
        self._config = config
        self._source = source
        self._origin = aircraft.origin
        self._home = aircraft.navigation.home
        self._flavour = aircraft.firmware
        self._commander = aircraft.control.commander
        self._guidance = aircraft.navigation.guidance
        self._plant = aircraft.plant
        self._battery = aircraft.battery
        self._mission = mission
        self._failsafes = aircraft.control.failsafes
        self._clock = aircraft.clock
        self._flight = flight
        self._fastest = vehicle.omega_max
        self._version = version(source, config.flavour)
        self._rotors = len(vehicle.rotors)
        self._hovering = _squares(hover_speeds(vehicle).tolist())
        reported = config.streams != "quiet" and config.flavour == "ardupilot"
        # MAVProxy takes a cleared bit as a breach, because ArduPilot always sets it.
        self._unbreached = mavlink.MAV_SYS_STATUS_GEOFENCE if reported else 0
        self._now = 0

    def configure(self, config: AutopilotConfig) -> None:
        """Use new settings from now on."""
        self._config = config

    def read(self, now: int) -> Snapshot:
        """Return the snapshot at ``now`` (µs since boot)."""
        self._now = now
        commander, flavour, plant = self._commander, self._flavour, self._plant
        armed = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if commander.armed else 0
        return Snapshot(
            self._source,
            self._clock.stamp(now),
            plant.estimate(),
            self._origin,
            commander.ready,
            commander.armed,
            self._rotors,
            flavour.autopilot,
            flavour.base_mode(commander.mode) | armed,
            flavour.custom_mode(commander.mode),
            self._landed_state(),
            self._target,
            flavour.echoes_yaw,
            plant.sensors.gps.located,
            plant.sensors.gps.fixed,
            plant.sensors.gps.test_ratio,
            plant.sensors.gps.spread,
            plant.sensors.silent(now),
            self._startup_progress(),
            self._home,
            None if self._battery is None else self._battery.charge,
            self._throttle,
            0 if self._failsafes.breached else self._unbreached,
            self._clock.epoch,
            self._version,
            self._mission,
            commander.ready and (commander.armed or self._armable(now)),
            self._failsafes.fence_status,
            self._lift,
            lambda: plant.state,
            self._demand,
            self._motors,
            self._flight,
        )

    def _armable(self, now: int) -> bool:
        return not self._failsafes.doubts() and self._commander.mode_doubt(now) is None

    def _landed_state(self) -> int:
        """Return the MAV_LANDED_STATE; a descent in PX4's position mode is not LANDING."""
        if self._commander.landed:
            state: int = mavlink.MAV_LANDED_STATE_ON_GROUND
        elif self._commander.mode is Mode.POSITION:
            state = mavlink.MAV_LANDED_STATE_IN_AIR
        else:
            state = _LANDED_STATES.get(self._guidance.activity, mavlink.MAV_LANDED_STATE_IN_AIR)
        return state

    def _target(self) -> Setpoint | None:
        guidance = self._guidance
        follows = guidance.activity is Activity.TRACK or guidance.activity is Activity.GO
        return guidance.wanted(self._now) if follows else None

    def _demand(self) -> tuple[Vector, float] | None:
        """Return the acceleration (m/s², local NED) and yaw (rad) that the controller aims at, or None."""
        reference = self._plant.course.reference
        if reference is None:
            return None
        return self._origin.vector_to_local(reference.acceleration), reference.yaw - self._origin.turn

    def _motors(self) -> tuple[float, ...]:
        """Return the rotor speeds over the greatest one."""
        return tuple(speed / self._fastest for speed in self._plant.state.rotor_speeds.tolist())

    def _startup_progress(self) -> float:
        """Return the start-up progress of GPS and filter, 0…1."""
        config = self._config
        if self._now >= config.ready_after * 1e6:
            return 1.0
        return self._now * 1e-6 / config.ready_after if config.startup == "in stages" else 0.0

    def _lift(self) -> float:
        """Return the rotors' thrust over mass (m/s²); standard gravity on the ground."""
        if self._plant.vehicle.on_ground:
            return GRAVITY
        return GRAVITY * _squares(self._plant.state.rotor_speeds.tolist()) / self._hovering

    def _throttle(self) -> float:
        """Return thrust over twice the hover thrust, at most 1."""
        return min(1.0, 0.5 * _squares(self._plant.state.rotor_speeds.tolist()) / self._hovering)


def _squares(speeds: list[float]) -> float:
    return sum(speed * speed for speed in speeds)
