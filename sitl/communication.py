"""Communication of an emulated autopilot: it handles received messages and returns those to send."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import CommandInt, CommandLong, Message, SetupSigning, Source
from mavlink_bridge.wire.signing import Signing
from sitl.autopilot.aircraft import Aircraft
from sitl.autopilot.command_protocol import Orders
from sitl.autopilot.failures import Failures
from sitl.autopilot.home_commands import HomeCommands
from sitl.autopilot.missions.items import home_item
from sitl.autopilot.missions.service import MissionService
from sitl.autopilot.parameters.settings import Settings
from sitl.autopilot.reception import Reception
from sitl.autopilot.records import Records
from sitl.autopilot.services import Services
from sitl.autopilot.trust import SigningSetup
from sitl.camera.service import CameraService
from sitl.snapshot import SnapshotReader
from sitl.telemetry.schedule import Telemetry
from sitl.telemetry.status_text import StatusReporter
from sitl.telemetry.streams import further_rates, usual_rates
from sitl.vehicle.config import VehicleConfig

# With more answers than this in a step, telemetry is sent before them.
_MANY_ANSWERS: Final = 32
# Limit of messages in answer to one datagram. A datagram that fits an Ethernet frame cannot exceed it: the
# shortest request takes 13 of 1500 bytes.
_MAX_ANSWERS: Final = 256


class Communication:
    """Handlers of messages for ``aircraft`` and its ``camera``, and the telemetry about it.

    ``received`` are the ids of the handled messages; ``telemetry`` can be asked for further ones. Times are
    µs since boot.
    """

    def __init__(
        self,
        source: Source,
        settings: Settings,
        vehicle: VehicleConfig,
        aircraft: Aircraft,
        camera: CameraService | None,
        signing: Signing | None,
        outbox: list[Message],
        reporter: StatusReporter,
    ) -> None:
        """Connect the handlers. ``reporter`` writes to ``outbox``; SETUP_SIGNING brings ``signing`` a key."""
        config, firmware = settings.config, aircraft.firmware
        navigation, control = aircraft.navigation, aircraft.control
        self._outbox, self._reporter = outbox, reporter
        self._commander, self._estimate = control.commander, aircraft.plant.estimate
        self._clock, self._camera = aircraft.clock, camera
        self.telemetry = telemetry = Telemetry(usual_rates(config), firmware.reports_ekf)
        self._records = Records(
            source, aircraft, settings.values, outbox, reporter, records=config.streams != "quiet"
        )
        self._records.report(telemetry)
        if (further := further_rates(config)) is not None:
            telemetry.stream(*further)
        self._missions = MissionService(
            source,
            navigation.plans,
            navigation.itinerary,
            self._commander,
            telemetry,
            outbox,
            reporter,
            asks_int=firmware.bytewise,
            home=None if firmware.bytewise else lambda: home_item(navigation.home),
            guided=None if firmware.bytewise else control.maneuvers.go,
        )
        self._services = Services(
            source,
            firmware,
            settings.values,
            telemetry,
            HomeCommands(
                navigation.home,
                aircraft.origin,
                telemetry,
                self._estimate,
                lambda: self._commander.ready,
                reporter,
            ),
            self._missions,
            Failures(aircraft.plant, aircraft.battery, lambda: settings.config),
            outbox,
            reporter,
            settings.apply,
            self._records.parts,
        )
        self._snapshots = SnapshotReader(
            config, vehicle, source, aircraft, self._missions.current, self._records.flight
        )
        settings.add(aircraft)
        settings.add(self._snapshots)
        self._signing_setup = SigningSetup(
            source, signing, config.signing_setup, lambda: self._commander.armed, reporter
        )
        self._reception = Reception(
            source,
            outbox,
            reporter,
            self._commander,
            Orders(self._commander, firmware, self._services.commands | control.maneuvers.commands),
            control.steering,
            navigation.following,
            {**self._services.handlers, SetupSigning: self._signing_setup.set_up},
            firmware.set_mode_ack,
            self._clock.stamp,
        )
        self.received = self._reception.received
        # These values are cached because they are empty or not due in nearly every step.
        self._reached = navigation.itinerary.reached
        self._work_due = self._services.next_due
        # A real ArduCopter sends HEARTBEAT at once after a mode change. Quiet flights do not.
        self._announces = config.streams != "quiet" and not firmware.bytewise
        self._was_ready = False
        telemetry.start(0)

    def watch(self, now: int) -> None:
        """Record the flight and announce the origin, after the aircraft has moved to ``now``."""
        ready = self._commander.ready
        if ready and not self._was_ready:
            self.telemetry.request(mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN)
        self._was_ready = ready
        self._records.watch(now)

    def receive(self, messages: Sequence[Message], now: int) -> None:
        """Handle the messages of one datagram that arrived at ``now``."""
        enough = len(self._outbox) + _MAX_ANSWERS
        for number, message in enumerate(messages):
            if len(self._outbox) >= enough:
                # Answers go to all receivers: excessive requests of one sender would crowd out the others.
                left = len(messages) - number
                self._reporter.complain(f"Requests refused: {left} of one datagram", now)
                break
            if self._camera is not None and isinstance(message, CommandLong | CommandInt):
                self._outbox += self._camera.handle(message, self._clock.stamp(now))
            mode = self._commander.mode
            self._reception.handle(message, now, self._estimate())
            if self._announces and self._commander.mode is not mode:
                self.telemetry.request(mavlink.MAVLINK_MSG_ID_HEARTBEAT)
        self._signing_setup.watch(now)
        self._work_due = self._services.next_due

    def send(self, now: int) -> list[Message]:
        """Return the answers and the telemetry due at ``now``."""
        if self._reached:
            self._missions.tell()
        if now >= self._work_due:
            self._services.work(now)
            self._work_due = self._services.next_due
        reported: list[Message] = []
        if now >= self.telemetry.next_due:
            reported = self.telemetry.collect(now, self._snapshots.read(now))
        # If there are many answers, the messages sent first are more likely to fit the link.
        answers = self._outbox
        messages = reported + answers if len(answers) > _MANY_ANSWERS else answers + reported
        answers.clear()
        return messages
