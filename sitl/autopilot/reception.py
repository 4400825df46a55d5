"""Reception of messages: it checks the addressee, dispatches each message and sends the answer."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import (
    BY_TYPE,
    CommandAck,
    CommandInt,
    CommandLong,
    FollowTarget,
    GlobalPosition,
    Heartbeat,
    Message,
    Ping,
    SetMode,
    SetpointAttitude,
    SetpointGlobal,
    SetpointLocal,
    Source,
    Timesync,
)
from sitl.autopilot.command_protocol import Orders
from sitl.autopilot.commander import Commander
from sitl.autopilot.following import Following
from sitl.autopilot.setpoint_reception import SetpointReception
from sitl.estimation.sensors import Estimate
from sitl.telemetry.status_text import StatusReporter

# The services add their own.
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


class Reception:
    """Dispatcher of messages for this vehicle to ``orders``, ``steering``, ``following`` and ``services``.

    It answers TIMESYNC (111) and PING (4) itself, and ignores messages for other systems. Answers go to
    ``outbox``.
    """

    def __init__(
        self,
        source: Source,
        outbox: list[Message],
        status_text: StatusReporter,
        commander: Commander,
        orders: Orders,
        steering: SetpointReception,
        following: Following,
        services: Mapping[type[Any], Callable[[Any, int], None]],
        set_mode_ack: int,
        stamp: Callable[[int], int],
    ) -> None:
        """Set the handlers.

        ``services`` maps a type of message to its handler, which takes a message and its time of arrival
        (µs). ``set_mode_ack`` is the command that COMMAND_ACK names in answer to SET_MODE (11).
        ``stamp`` returns what the autopilot's clock shows (µs since boot) at a time (µs since boot).
        """
        self._source = source
        self._outbox = outbox
        self._status_text = status_text
        self._commander = commander
        self._orders = orders
        self._steering = steering
        self._following = following
        self._services = services
        self._set_mode_ack = set_mode_ack
        self._stamp = stamp
        self._autopilots: set[Source] = set()

    @property
    def received(self) -> frozenset[int]:
        """Ids of the messages that are handled; others may be dropped before they are decoded."""
        return _RECEIVED | {BY_TYPE[kind].id for kind in self._services}

    def handle(self, message: Message, now: int, estimate: Estimate) -> None:
        """Handle a message that arrived at ``now`` (µs since boot), with the ``estimate`` of that time."""
        match message:
            case SetpointLocal() | SetpointGlobal() | SetpointAttitude():
                if self._is_mine(message.target_system, message.target_component):
                    self._steer(message, now, estimate)
            case CommandLong() | CommandInt():
                if self._is_mine(message.target_system, message.target_component):
                    self._obey(message, now)
            case FollowTarget() | GlobalPosition():
                if self._commander.follows and message.source.system != self._source.system:
                    self._following.receive(message, estimate.pose, now)
            case Heartbeat():
                self._note(message)
            case Timesync(tc1=0) if message.source in self._autopilots:
                # Other autopilots on a shared link ask at 10 Hz; each would answer each of them.
                pass
            case Timesync(tc1=0):
                # Zero would make the reply a request.
                self._outbox.append(Timesync(self._source, max(1, self._stamp(now) * 1000), message.ts1))
            case Ping(target_system=0):
                system, component = message.source
                self._outbox.append(Ping(self._source, message.time, message.sequence, system, component))
            case SetMode():
                if self._is_mine(message.target_system, 0):
                    self._change_mode(message, now)
            case _:
                self._serve(message, now)

    def _note(self, heartbeat: Heartbeat) -> None:
        """Note whether the sender is an autopilot; a client may use an autopilot's component id as well."""
        if heartbeat.source.component != self._source.component:
            return
        if heartbeat.autopilot == mavlink.MAV_AUTOPILOT_INVALID:
            self._autopilots.discard(heartbeat.source)
        else:
            self._autopilots.add(heartbeat.source)

    def _steer(
        self, message: SetpointLocal | SetpointGlobal | SetpointAttitude, now: int, estimate: Estimate
    ) -> None:
        if self._steering.steer(message, self._commander.status(now), estimate.pose, now):
            self._commander.steered(now)

    def _obey(self, message: CommandLong | CommandInt, now: int) -> None:
        result, reason = self._orders.obey(message, now)
        self._outbox.append(CommandAck(self._source, message.command, result, 0, 0, *message.source))
        if reason and result == mavlink.MAV_RESULT_UNSUPPORTED:
            self._status_text.mention(reason, now)
        elif reason:
            self._status_text.complain(reason, now)

    def _change_mode(self, message: SetMode, now: int) -> None:
        result, reason = self._orders.set_mode(message.custom_mode, message.base_mode, now)
        self._outbox.append(CommandAck(self._source, self._set_mode_ack, result, 0, 0, *message.source))
        if reason:
            self._status_text.complain(reason, now)

    def _serve(self, message: Message, now: int) -> None:
        handle = self._services.get(type(message))
        if handle is None:
            return
        # Not every message has a target component; each of these has a target system.
        component: int = getattr(message, "target_component", 0)
        if self._is_mine(getattr(message, "target_system", -1), component):
            handle(message, now)

    def _is_mine(self, system: int, component: int) -> bool:
        return system in (0, self._source.system) and component in (0, self._source.component)
