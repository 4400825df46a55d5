"""Emulated autopilot as a node: it receives datagrams, simulates the physics and returns datagrams."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt
from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import Message, Source, Vector
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.signing import Signing
from sitl.autopilot.aircraft import Aircraft
from sitl.autopilot.endpoint import Endpoint
from sitl.autopilot.firmware import Mode
from sitl.autopilot.parameters.settings import Settings
from sitl.autopilot.saved import Saved
from sitl.autopilot.trust import resumed
from sitl.camera.camera import Camera
from sitl.camera.scene import LINK as SIGHT
from sitl.camera.scene import Scene
from sitl.camera.service import CameraService
from sitl.camera.truth_link import TruthLink
from sitl.communication import Communication
from sitl.config.autopilot import AutopilotConfig
from sitl.environment.weather import WeatherConfig
from sitl.estimation.sensors import Estimate
from sitl.telemetry.status_text import StatusReporter
from sitl.vehicle.config import VehicleConfig
from sitl.vehicle.multirotor import Reference, VehicleState

LINK: Final = "autopilot"
"""Link of all messages; the ground truth that a camera sees comes on the link ``sight``."""


class Autopilot:
    """One vehicle with its autopilot and its camera, as a ``Node`` with the link ``autopilot``.

    The physics runs in the NED frame of ``site``; messages use the vehicle's own local NED. The autopilot
    flies on the estimate of its sensors. The program that composes a simulation can read the truth of the
    last step (``trace``, ``trace_times``, ``moved_to``, ``state``, ``reference``), call ``begin`` and inject
    faults, which act from the next step on.
    """

    def __init__(
        self,
        config: AutopilotConfig,
        vehicle: VehicleConfig,
        site: FleetFrame,
        seed: int,
        weather: WeatherConfig | None = None,
        saved: Saved | None = None,
        signing: Signing | None = None,
        scene: Scene | None = None,
    ) -> None:
        """Start at the configured place, on the ground or at the configured height above it.

        The place becomes the origin of the vehicle's local frame. ``seed`` (≥ 0) and the system id seed all
        noise. ``weather`` describes the surrounding air; without it the air is still. ``saved`` is the data
        kept from an earlier run. ``signing`` is the autopilot's own, with the key shared by all authorised
        senders; without it any sender may command the autopilot. ``scene``: what the vehicle's camera may
        see; with it, the vehicle also sends where it truly is on the link ``sight``.
        """
        saved = saved or Saved()
        self._settings = settings = Settings(config, len(vehicle.rotors), saved.parameters)
        config = settings.config
        source = Source(config.system_id, mavlink.MAV_COMP_ID_AUTOPILOT1)
        outbox: list[Message] = []
        reporter = StatusReporter(source, outbox)
        self._aircraft = aircraft = Aircraft(
            config, vehicle, site, seed, weather or WeatherConfig(), saved, reporter
        )
        self._plant, self._commander = aircraft.plant, aircraft.control.commander
        self.camera: Camera | None = None
        service: CameraService | None = None
        if vehicle.camera is not None:
            self.camera = Camera(
                vehicle.camera, scene or Scene(), aircraft.origin, site, seed, config.system_id
            )
            service = CameraService(self.camera)
        # Others' cameras see this vehicle.
        self._truth_link = TruthLink(source, site, self.camera, shows=scene is not None)
        signing = resumed(signing, config.signing_setup, saved.signed_until)
        self._communication = Communication(
            source, settings, vehicle, aircraft, service, signing, outbox, reporter
        )
        self._endpoint = Endpoint(self._communication.received, signing)
        self._boot: int | None = None

    @property
    def config(self) -> AutopilotConfig:
        """Present configuration, with the changes by parameters."""
        return self._settings.config

    @property
    def name(self) -> str:
        """Name of the node, as unique as its system id."""
        return f"sitl-{self.config.system_id}"

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        """Advance to ``now`` (µs), process the received datagrams, then return the messages due.

        The result is one datagram or none, and more only after a flood of requests and in a download. All
        messages about one image are in one datagram. Messages received at ``now`` take effect from ``now``
        on. The first call is the boot.
        """
        if self._boot is None:
            self._boot = now
            self._aircraft.clock.boot(now)
        now -= self._boot  # From here on, µs since boot.
        self._endpoint.present(self._aircraft.clock.boot_epoch + now)
        self._aircraft.move(now)
        self._communication.watch(now)
        self._aircraft.check(now)
        if self.camera is not None:
            self._take_image(self.camera)
        for datagram in inbox:
            self._receive(datagram, now)
        return self._send(now) + self._show(now)

    def _take_image(self, camera: Camera) -> None:
        """Let the camera see the truth of the last physics step, once the position is known."""
        plant, stamp = self._plant, self._aircraft.clock.stamp
        if self._commander.ready:
            boot = self._boot or 0
            camera.step(plant.time, boot, plant.state, plant.estimate, stamp(plant.time))

    def _receive(self, datagram: Datagram, now: int) -> None:
        if datagram.link == SIGHT:
            self._truth_link.receive(datagram.data)
        elif datagram.link == LINK:
            self._communication.receive(self._endpoint.read(datagram.data), now)

    def _send(self, now: int) -> list[Datagram]:
        messages = self._communication.send(now)
        seen = [] if self.camera is None else self.camera.messages(now, self._boot or 0)
        # What belongs to one image stays in one datagram.
        return [Datagram(LINK, data) for data in self._endpoint.write(messages, together=seen)]

    def _show(self, now: int) -> list[Datagram]:
        """Return the truth about this vehicle, for the cameras of others, if it is due."""
        if not self._truth_link.due(now):
            return []
        return [self._truth_link.show(now, self.moved_to, self._plant.state.position)]

    @property
    def saved(self) -> Saved:
        """Data to keep for the next boot."""
        return Saved(
            parameters=self._settings.values.changed,
            plans=self._aircraft.navigation.plans.all,
            signed_until=self._endpoint.signed_until,
        )

    @property
    def not_encoded(self) -> int:
        """Number of messages that could not be encoded."""
        return self._endpoint.not_encoded

    # Events and faults, effective from the next step

    def begin(self, now: int) -> None:
        """Mark the goal event at ``now`` (µs, clock of ``step``), the time origin of the weather's gusts."""
        self._plant.begin(now - (now if self._boot is None else self._boot))

    def lose_gps(self) -> None:
        """Stop GPS: the estimate drifts; after the firmware's time-out its position is reported as lost."""
        self._plant.lose_gps()

    def regain_gps(self) -> None:
        """Restore GPS: the estimate converges to GPS, in one jump if its position was reported as lost."""
        self._plant.sensors.gps.regain()

    def fail_rotor(self, index: int, left: float) -> None:
        """Limit the rotor ``index`` (0…n−1) to the fraction ``left`` (0…1) of its motor's speed from now on.

        The autopilot receives no indication. Raises IndexError and ValueError.
        """
        self._plant.vehicle.fail_rotor(index, left)

    def shift_utc(self, by: int) -> None:
        """Shift the UTC of SYSTEM_TIME by ``by`` (µs) from now on."""
        self._aircraft.clock.shift_utc(by)

    def shift_gps(self, offset_enu: Vector) -> None:
        """Set the error of GPS positions to ``offset_enu`` (m, fleet-local ENU); zero ends the fault.

        The estimate follows within some seconds, or jumps after rejecting GPS for seven seconds.
        """
        east, north, up = offset_enu
        self._plant.shift_gps(self._aircraft.origin.vector_to_local(np.array((north, east, -up))))

    # Ground truth

    @property
    def trace(self) -> npt.NDArray[np.float64]:
        """Positions (n, 3) (m, site NED) after each physics step of the last ``step``."""
        return self._plant.trace

    @property
    def moved_to(self) -> int:
        """End time of the last physics step (µs, on the clock of ``step``)."""
        return self._plant.time + (self._boot or 0)

    @property
    def trace_times(self) -> npt.NDArray[np.int64]:
        """Times (n,) of the positions in ``trace`` (µs, on the clock of ``step``)."""
        return self._plant.trace_times + (self._boot or 0)

    @property
    def state(self) -> VehicleState:
        """True state, site NED; it is cached, so do not modify it."""
        return self._plant.state

    @property
    def wind(self) -> Vector:
        """Velocity of the air (m/s, site NED) in the last physics step."""
        return self._plant.wind

    @property
    def armed(self) -> bool:
        """Whether the motors may turn."""
        return self._commander.armed

    @property
    def airborne(self) -> bool:
        """Whether the vehicle is off the ground; after a touchdown, true until it counts as landed."""
        return not self._commander.landed

    @property
    def mode(self) -> Mode:
        """Flight mode."""
        return self._commander.mode

    @property
    def custom_mode(self) -> int:
        """Flight mode as encoded in HEARTBEAT (0)."""
        return self._aircraft.firmware.custom_mode(self._commander.mode)

    @property
    def charge(self) -> float:
        """Remaining battery charge, 0…1; 1 without a battery."""
        battery = self._aircraft.battery
        return 1.0 if battery is None else battery.charge.remaining

    @property
    def estimate(self) -> Estimate:
        """Estimated state, in the own local NED."""
        return self._plant.estimate()

    @property
    def estimate_error(self) -> npt.NDArray[np.float64]:
        """Estimated minus true position (3,) (m, site NED).

        The vehicle is controlled to ``reference`` less this error.
        """
        return self._plant.estimate_error

    @property
    def reference(self) -> Reference | None:
        """Reference requested now (site NED, for the estimated state), or None if there is none."""
        return self._plant.course.reference
