"""Services of an autopilot beside flying: parameters, requests, files, home, missions, failures.

The module maps messages and commands to their handlers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import (
    Message,
    ParamRequestList,
    ParamRequestRead,
    ParamSet,
    RequestDataStream,
    SetGpsGlobalOrigin,
    SetHomePosition,
    Source,
)
from sitl.autopilot.command_protocol import Handler, Order
from sitl.autopilot.failures import Failures
from sitl.autopilot.firmware import CommandRefusal, Firmware
from sitl.autopilot.home_commands import HomeCommands
from sitl.autopilot.message_requests import Requests
from sitl.autopilot.missions.service import MissionService
from sitl.autopilot.parameters.ardupilot import STREAMS
from sitl.autopilot.parameters.protocol import ParameterProtocol
from sitl.autopilot.parameters.values import Values
from sitl.telemetry.schedule import Telemetry
from sitl.telemetry.status_text import StatusReporter


class Part(Protocol):
    """Protocol with work of its own: ``next_due`` (µs) is when it is due."""

    next_due: int

    def work(self, now: int, /) -> None:
        """Do the work due at ``now`` (µs)."""
        ...


class Protocols(Part, Protocol):
    """Part with ``handlers`` by type of message."""

    handlers: dict[type[Any], Callable[[Any, int], None]]


class Services:
    """Services: ``handlers`` by type of message, ``commands`` by MAV_CMD.

    ``next_due`` (µs): nothing is due before it.
    """

    def __init__(
        self,
        source: Source,
        flavour: Firmware,
        values: Values,
        telemetry: Telemetry,
        home_commands: HomeCommands,
        missions: MissionService,
        failures: Failures,
        outbox: list[Message],
        status_text: StatusReporter,
        configure: Callable[[], None],
        parts: Sequence[Protocols],
    ) -> None:
        """``configure`` is called when a parameter has changed; ``parts`` are further protocols."""
        self._values = values
        self._configure = configure
        self._requests = Requests(source, flavour, telemetry, outbox)
        self._rates = dict.fromkeys(STREAMS, 0.0) if flavour.groups_streams else {}
        self._now = 0
        self.parameters = ParameterProtocol(
            source, values, outbox, status_text, self._changed, bytewise=flavour.bytewise
        )
        self._parts: tuple[Part, ...] = (self.parameters, missions.transfer, *parts)
        self.handlers: dict[type[Any], Callable[[Any, int], None]] = {
            ParamRequestList: self.parameters.handle,
            ParamRequestRead: self.parameters.handle,
            ParamSet: self._set_parameter,
            RequestDataStream: self._requests.stream,
            SetHomePosition: home_commands.set_home,
            SetGpsGlobalOrigin: home_commands.set_origin,
            **missions.handlers,
            **{kind: handle for part in parts for kind, handle in part.handlers.items()},
        }
        self.commands: dict[int, Handler] = {
            **self._requests.commands,
            **home_commands.commands,
            **missions.commands,
            **failures.commands,
            mavlink.MAV_CMD_PREFLIGHT_STORAGE: self._store,
        }
        if flavour.stops:
            self.commands[mavlink.MAV_CMD_DO_FENCE_ENABLE] = self._enable_fence
        self._stream(0)

    @property
    def next_due(self) -> int:
        """Time before which no ``work`` is due (µs)."""
        return min(part.next_due for part in self._parts)

    def work(self, now: int) -> None:
        """Do the work due at ``now`` (µs)."""
        for part in self._parts:
            if now >= part.next_due:
                part.work(now)

    def _set_parameter(self, message: ParamSet, now: int) -> None:
        self._now = now
        self.parameters.handle(message, now)

    def _changed(self) -> None:
        self._configure()
        self._stream(self._now)

    def _stream(self, now: int, *, resets: bool = False) -> None:
        """Apply ArduPilot's SR0_ parameters to the rates of their message groups, where they changed."""
        for group, rate in self._rates.items():
            wanted = self._values.named(f"SR0_{group}")
            if wanted != rate:
                self._rates[group] = wanted
                # 0 is the initial value: a reset to it restores the default rates.
                usual = wanted == 0.0 and resets
                self._requests.set_rate(STREAMS[group], None if usual else wanted, now)

    def _enable_fence(self, order: Order) -> CommandRefusal | None:
        """Execute ArduPilot's DO_FENCE_ENABLE: parameter 1 is FENCE_ENABLE."""
        number = self._values.number("FENCE_ENABLE")
        if number is None or order.params[0] not in (0.0, 1.0):
            return CommandRefusal(mavlink.MAV_RESULT_DENIED, "Fence refused: parameter 1 must be 0 or 1")
        self._values.set(number, order.params[0])
        self._now = order.now
        self._changed()
        return None

    def _store(self, order: Order) -> CommandRefusal | None:
        """Execute PREFLIGHT_STORAGE: values are always kept; a reset restores the initial ones."""
        wish = order.params[0]
        if wish == mavlink.PARAM_RESET_FACTORY_DEFAULT:
            self._values.reset()
            self._configure()
            self._stream(order.now, resets=True)
            return None
        if wish in (mavlink.PARAM_READ_PERSISTENT, mavlink.PARAM_WRITE_PERSISTENT):
            return None
        return CommandRefusal(mavlink.MAV_RESULT_DENIED, "Storage refused: parameter 1 must be 0, 1 or 2")
