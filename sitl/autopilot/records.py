"""What a vehicle keeps and gives out as files: flight logs, parameters, metadata, with their protocols."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import (
    BY_TYPE,
    AvailableModesMonitor,
    ComponentMetadata,
    CurrentMode,
    Message,
    Source,
)
from sitl.autopilot.aircraft import Aircraft
from sitl.autopilot.component_files import GENERAL, ComponentFiles
from sitl.autopilot.files import FileServer
from sitl.autopilot.firmware.mode_list import standard_mode
from sitl.autopilot.flight_times import FlightTimes
from sitl.autopilot.logs.dataflash import DataFlash
from sitl.autopilot.logs.moment import LoggedParameter, Moment
from sitl.autopilot.logs.protocol import LogProtocol
from sitl.autopilot.logs.recorder import Recorder
from sitl.autopilot.logs.ulog import Ulog
from sitl.autopilot.parameters.parameter import Kind
from sitl.autopilot.parameters.values import Values
from sitl.telemetry.reports import Snapshot
from sitl.telemetry.schedule import Telemetry
from sitl.telemetry.status_text import StatusReporter

_FOLDERS: Final = {False: "APM/LOGS", True: "fs/microsd/log"}


class Records:
    """Logs and files of one vehicle. ``parts`` are their protocols; ``flight``: times of the flight."""

    def __init__(
        self,
        source: Source,
        aircraft: Aircraft,
        values: Values,
        outbox: list[Message],
        reporter: StatusReporter,
        *,
        records: bool,
    ) -> None:
        """``records``: whether flights are recorded; without, there are no logs."""
        self._commander = commander = aircraft.control.commander
        self._firmware, self._records = aircraft.firmware, records
        self._plant, self._origin, self._home = aircraft.plant, aircraft.origin, aircraft.navigation.home
        self._clock = clock = aircraft.clock
        self._values = values
        self._px4 = px4 = aircraft.firmware.bytewise
        encoder: type[DataFlash] | type[Ulog] = Ulog if px4 else DataFlash
        self._recorder = Recorder(encoder, self._moment, self._parameters, lambda: clock.epoch)
        self.flight = FlightTimes()
        self._files = ComponentFiles(values, metadata=px4, logs=self._logs)
        self.parts = (
            FileServer(source, outbox, self._files, chooses_session=px4),
            LogProtocol(
                source,
                outbox,
                self._recorder,
                reporter,
                lambda: commander.armed,
                first=0 if px4 else 1,
                refuses_armed=not px4,
            ),
        )

    def watch(self, now: int) -> None:
        """Record what is due at ``now`` (µs since boot)."""
        commander = self._commander
        self.flight.watch(now, armed=commander.armed, landed=commander.landed)
        if self._records:
            mode = self._firmware.custom_mode(commander.mode)
            self._recorder.watch(self._clock.stamp(now), armed=commander.armed, custom_mode=mode)

    def report(self, telemetry: Telemetry) -> None:
        """Add the messages about files and modes."""
        firmware, commander = self._firmware, self._commander

        def current(s: Snapshot) -> Message:
            mode = commander.mode
            chosen = firmware.custom_mode(commander.chosen_mode)
            return CurrentMode(s.source, firmware.custom_mode(mode), chosen, standard_mode(firmware, mode))

        def metadata(s: Snapshot) -> Message:
            return ComponentMetadata(s.source, s.time, self._files.general_crc, f"mftp://{GENERAL}")

        monitor: Callable[[Snapshot], Message] = lambda s: AvailableModesMonitor(s.source, 1)  # noqa: E731
        telemetry.add(mavlink.MAVLINK_MSG_ID_AVAILABLE_MODES_MONITOR, monitor)
        if self._px4:
            telemetry.add(mavlink.MAVLINK_MSG_ID_CURRENT_MODE, current)
            telemetry.add(BY_TYPE[ComponentMetadata].id, metadata)

    def _moment(self, now: int) -> Moment:
        estimate = self._plant.estimate()
        place = self._origin.geodetic(estimate.position)
        return Moment(now, estimate, *place, self._home.altitude)

    def _parameters(self) -> Iterable[LoggedParameter]:
        values = self._values
        return (
            LoggedParameter(
                parameter.name,
                values.value(number),
                values.initial(number),
                whole=parameter.kind is not Kind.REAL32,
            )
            for number, parameter in enumerate(values.table)
        )

    def _logs(self) -> Mapping[str, bytearray]:
        """Return the logs by path: numbered in ArduPilot's folder, sessions in PX4's, and none elsewhere."""
        folder, extension = _FOLDERS[self._px4], self._recorder.extension
        if self._px4:
            return {
                f"{folder}/sess{log.number:03}/log001.{extension}": log.data for log in self._recorder.logs
            }
        return {f"{folder}/{log.number:08}.{extension}": log.data for log in self._recorder.logs}
