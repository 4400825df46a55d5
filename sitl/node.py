"""Emulated autopilot as a node: it receives datagrams, simulates the physics and returns datagrams.

The module is long because it composes all parts.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt
from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.errors import EncodeError
from mavlink_bridge.frames import FleetFrame, ned_to_enu
from mavlink_bridge.messages import (
    BY_TYPE,
    CommandInt,
    CommandLong,
    HilState,
    Message,
    SetupSigning,
    Source,
    Vector,
)
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.packing import parcels
from mavlink_bridge.wire.signing import Signing
from sitl.autopilot.command_protocol import Orders
from sitl.autopilot.failures import Failures
from sitl.autopilot.firmware import Firmware, Mode
from sitl.autopilot.firmware.ardupilot import ArduPilot
from sitl.autopilot.firmware.px4 import Px4
from sitl.autopilot.flight_control import FlightControl
from sitl.autopilot.home_commands import HomeCommands
from sitl.autopilot.missions.items import Item
from sitl.autopilot.missions.service import MissionService
from sitl.autopilot.navigation import Navigation
from sitl.autopilot.own_clock import OwnClock
from sitl.autopilot.parameters import ardupilot as ardupilot_parameters
from sitl.autopilot.parameters import px4 as px4_parameters
from sitl.autopilot.parameters.values import Values
from sitl.autopilot.plant import Plant
from sitl.autopilot.reception import Reception
from sitl.autopilot.records import Records
from sitl.autopilot.saved import Saved
from sitl.autopilot.services import Services
from sitl.autopilot.trust import SigningSetup
from sitl.camera.camera import Camera
from sitl.camera.scene import LINK as SIGHT
from sitl.camera.scene import Scene, truth
from sitl.camera.service import CameraService
from sitl.config.autopilot import AutopilotConfig
from sitl.environment.weather import WeatherConfig
from sitl.estimation.sensors import Estimate
from sitl.snapshot import SnapshotReader
from sitl.telemetry.schedule import Telemetry
from sitl.telemetry.status_text import StatusReporter
from sitl.telemetry.streams import further_rates, usual_rates
from sitl.values.origin import Origin
from sitl.vehicle.airframe import hover_speeds
from sitl.vehicle.battery import Battery
from sitl.vehicle.config import VehicleConfig
from sitl.vehicle.multirotor import Reference, VehicleState

LINK: Final = "autopilot"
"""Link of all messages; the ground truth that a camera sees comes on the link ``sight``."""

# Message ids; the services add their own.
_RECEIVED: Final = frozenset(
    (
        mavlink.MAVLINK_MSG_ID_HEARTBEAT,
        mavlink.MAVLINK_MSG_ID_PING,
        mavlink.MAVLINK_MSG_ID_SET_MODE,
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        mavlink.MAVLINK_MSG_ID_COMMAND_INT,
        mavlink.MAVLINK_MSG_ID_COMMAND_LONG,
        mavlink.MAVLINK_MSG_ID_SET_ATTITUDE_TARGET,
        mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED,
        mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_GLOBAL_INT,
        mavlink.MAVLINK_MSG_ID_TIMESYNC,
        mavlink.MAVLINK_MSG_ID_FOLLOW_TARGET,
    )
)
_TRUTH: Final[int] = mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION
_SHOWN_US: Final = 50_000
# With more answers than this in a step, telemetry is sent before them.
_MANY_ANSWERS: Final = 32
# Limit of messages in answer to one datagram. A datagram that fits an Ethernet frame cannot exceed it: the
# shortest request takes 13 of 1500 bytes.
_MAX_ANSWERS: Final = 256
_TABLES: Final = {"ardupilot": ardupilot_parameters.table, "px4": px4_parameters.table}
_FIRMWARE: Final[dict[str, type[ArduPilot] | type[Px4]]] = {"ardupilot": ArduPilot, "px4": Px4}


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
        self._values = Values(_TABLES[config.flavour](len(vehicle.rotors)), config, saved.parameters)
        self._configured = config
        self.config = config = self._values.configured(config)
        self._source = source = Source(config.system_id, mavlink.MAV_COMP_ID_AUTOPILOT1)
        self._outbox: list[Message] = []
        self._status_text = reporter = StatusReporter(source, self._outbox)
        self._firmware: Firmware = _FIRMWARE[config.flavour](config)
        self._origin = Origin(site, config.latitude, config.longitude, config.altitude)
        self._navigation = navigation = Navigation(config, self._firmware, self._origin, saved)
        self._plant = plant = Plant(
            config,
            vehicle,
            weather or WeatherConfig(),
            navigation.guidance,
            self._origin,
            self._firmware.coasting,
            seed,
        )
        self._battery = (
            None if config.battery is None else Battery(config.battery, hover_speeds(vehicle).tolist())
        )
        control = FlightControl(config, self._firmware, navigation, plant.estimate, self._battery, reporter)
        self._clock = OwnClock(config)
        self._commander, self._failsafes = control.commander, control.failsafes
        self._telemetry = Telemetry(usual_rates(config), self._firmware.reports_ekf)
        self._records = records = Records(
            source,
            self._firmware,
            self._commander,
            plant,
            self._origin,
            navigation.home,
            self._clock,
            self._values,
            self._outbox,
            reporter,
            records=config.streams != "quiet",
        )
        records.report(self._telemetry)
        if (further := further_rates(config)) is not None:
            self._telemetry.stream(*further)
        self._missions = MissionService(
            source,
            navigation.plans,
            navigation.itinerary,
            self._commander,
            self._telemetry,
            self._outbox,
            reporter,
            asks_int=self._firmware.bytewise,
            home=None if self._firmware.bytewise else self._home_item,
            guided=None if self._firmware.bytewise else control.maneuvers.go,
        )
        self._services = Services(
            source,
            self._firmware,
            self._values,
            self._telemetry,
            HomeCommands(
                navigation.home,
                self._origin,
                self._telemetry,
                plant.estimate,
                lambda: self._commander.ready,
                reporter,
            ),
            self._missions,
            Failures(plant, self._battery, lambda: self.config),
            self._outbox,
            reporter,
            self._configure,
            records.parts,
        )
        self._snapshots = SnapshotReader(
            config,
            vehicle,
            source,
            self._origin,
            navigation.home,
            self._firmware,
            self._commander,
            navigation.guidance,
            plant,
            self._battery,
            self._missions.current,
            self._failsafes,
            self._clock,
            records.flight,
        )
        commands = self._services.commands | control.maneuvers.commands
        self._reception = Reception(
            source,
            self._outbox,
            reporter,
            self._commander,
            Orders(self._commander, self._firmware, commands),
            control.steering,
            navigation.following,
            self._services.handlers,
            self._firmware.set_mode_ack,
            self._clock.stamp,
        )
        self._signing = signing = _resumed(signing, config, saved)
        self._trust = SigningSetup(
            source, signing, config.signing_setup, lambda: self._commander.armed, reporter
        )
        self._services.handlers[SetupSigning] = self._trust.set_up
        received = _RECEIVED | {BY_TYPE[kind].id for kind in self._services.handlers}
        self._codec = Codec(lambda message_id, _system, _component: message_id in received, signing)
        self.camera: Camera | None = None
        self._truth_codec = Codec(lambda message_id, _system, _component: message_id == _TRUTH)
        # Others' cameras see this vehicle.
        self._shows, self._next_shown = scene is not None, 0
        if vehicle.camera is not None:
            self.camera = Camera(vehicle.camera, scene or Scene(), self._origin, site, seed, config.system_id)
            self._camera_service = CameraService(self.camera)
        # These values are cached because they are empty or not due in nearly every step.
        self._reached = navigation.itinerary.reached
        self._work_due = self._services.next_due
        # A real ArduCopter sends HEARTBEAT at once after a mode change. Quiet flights do not.
        self._announces = config.streams != "quiet" and not self._firmware.bytewise
        self.not_encoded = 0
        """Number of messages that could not be encoded."""
        self._boot: int | None = None
        self._now = 0
        if config.start_height:
            self._commander.begin_in_air()

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
            self._clock.boot(now)
            self._telemetry.start(0)
        self._now = now - self._boot
        if self._signing is not None:
            self._signing.present(self._clock.boot_epoch + self._now)
        self._plant.move(self._now, armed=self._commander.armed)
        self._watch()
        if self.camera is not None:
            self._take_image(self.camera)
        for datagram in inbox:
            self._receive(datagram)
        return self._send() + self._show()

    def _watch(self) -> None:
        was_ready = self._commander.ready
        self._commander.watch(self._now, self._plant.vehicle.on_ground, self._plant.sensors.gps.located)
        if self._commander.ready and self._plant.sensors.gps.fixed:
            self._clock.locate(self._now)
        if self._commander.ready and not was_ready:
            self._telemetry.request(mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN)
        self._records.watch(self._now)
        if self._battery is not None and self._battery.due(self._now):
            self._battery.advance(self._now, self._plant.state.rotor_speeds.tolist())
        if self._now >= self._failsafes.next_due:
            self._failsafes.watch(self._now)

    def _take_image(self, camera: Camera) -> None:
        """Let the camera see the truth of the last physics step, once the position is known."""
        plant, stamp = self._plant, self._clock.stamp
        if self._commander.ready:
            boot = self._boot or 0
            camera.step(plant.time, boot, plant.state, plant.estimate, stamp(plant.time))

    def _show(self) -> list[Datagram]:
        """Return the truth about this vehicle, for the cameras of others, if it is due."""
        if not self._shows or self._now < self._next_shown:
            return []
        self._next_shown = self._now + _SHOWN_US
        plant = self._plant
        place, time = ned_to_enu(plant.state.position), plant.time + (self._boot or 0)
        said = truth(self._source, time, place, self._origin.site)
        return [Datagram(SIGHT, self._truth_codec.encode(said))]

    def _receive(self, datagram: Datagram) -> None:
        if datagram.link == SIGHT and self.camera is not None:
            for sight in self._truth_codec.feed(datagram.data, whole=True):
                if isinstance(sight, HilState):
                    self.camera.receive(sight)
        if datagram.link != LINK:
            return
        enough = len(self._outbox) + _MAX_ANSWERS
        messages = self._codec.feed(datagram.data, whole=True)
        for number, message in enumerate(messages):
            if len(self._outbox) >= enough:
                # Answers go to all receivers: excessive requests of one sender would crowd out the others.
                left = len(messages) - number
                self._status_text.complain(f"Requests refused: {left} of one datagram", self._now)
                break
            if self.camera is not None and isinstance(message, CommandLong | CommandInt):
                self._outbox += self._camera_service.handle(message, self._clock.stamp(self._now))
            mode = self._commander.mode
            self._reception.handle(message, self._now, self._plant.estimate())
            if self._announces and self._commander.mode is not mode:
                self._telemetry.request(mavlink.MAVLINK_MSG_ID_HEARTBEAT)
        self._trust.watch(self._now)
        self._work_due = self._services.next_due

    def _send(self) -> list[Datagram]:
        if self._reached:
            self._missions.tell()
        if self._now >= self._work_due:
            self._services.work(self._now)
            self._work_due = self._services.next_due
        messages = self._outbox
        if self._now >= self._telemetry.next_due:
            reported = self._telemetry.collect(self._now, self._snapshots.read(self._now))
            # If there are many answers, the messages sent first are more likely to fit the link.
            messages = reported + messages if len(messages) > _MANY_ANSWERS else messages + reported
        seen = [] if self.camera is None else self.camera.messages(self._now, self._boot or 0)
        if not messages and not seen:
            return []
        pieces = [encoded for message in messages if (encoded := self._encoded(message))]
        if seen:
            # In one piece: what belongs to one image stays in one datagram.
            pieces.append(b"".join(map(self._encoded, seen)))
        data = parcels(pieces)
        self._outbox.clear()
        return [Datagram(LINK, parcel) for parcel in data]

    def _encoded(self, message: Message) -> bytes:
        """Encode a message.

        Return empty bytes if a value does not fit, because such a message must not stop the vehicle.
        """
        try:
            return self._codec.encode(message)
        except EncodeError:
            self.not_encoded += 1
            return b""

    def _home_item(self) -> Item:
        """Return ArduPilot's item 0: home."""
        home = self._navigation.home
        x, y = round(home.latitude * 1e7), round(home.longitude * 1e7)
        waypoint, frame = mavlink.MAV_CMD_NAV_WAYPOINT, mavlink.MAV_FRAME_GLOBAL
        return Item(frame, waypoint, 1, (0.0, 0.0, 0.0, 0.0), x, y, home.altitude)

    def _configure(self) -> None:
        """Apply the parameters that are settings.

        The system id is excepted: it takes effect at the next boot.
        """
        changed = self._values.configured(self._configured)
        self.config = changed.model_copy(update={"system_id": self.config.system_id})
        for part in (
            self._firmware,
            self._navigation.guidance,
            self._commander,
            self._navigation.modes,
            self._snapshots,
        ):
            part.configure(self.config)

    @property
    def saved(self) -> Saved:
        """Data to keep for the next boot."""
        until = 0 if self._signing is None else self._signing.newest
        return Saved(parameters=self._values.changed, plans=self._navigation.plans.all, signed_until=until)

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
        self._clock.shift_utc(by)

    def shift_gps(self, offset_enu: Vector) -> None:
        """Set the error of GPS positions to ``offset_enu`` (m, fleet-local ENU); zero ends the fault.

        The estimate follows within some seconds, or jumps after rejecting GPS for seven seconds.
        """
        east, north, up = offset_enu
        self._plant.shift_gps(self._origin.vector_to_local(np.array((north, east, -up))))

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
        return self._firmware.custom_mode(self._commander.mode)

    @property
    def charge(self) -> float:
        """Remaining battery charge, 0…1; 1 without a battery."""
        return 1.0 if self._battery is None else self._battery.charge.remaining

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


def _resumed(signing: Signing | None, config: AutopilotConfig, saved: Saved) -> Signing | None:
    """Return the signing to use, if any, with timestamps that continue those of an earlier run."""
    if signing is None and config.signing_setup == "obeyed":
        signing = Signing()
    if signing is not None:
        signing.resume(saved.signed_until)
    return signing
