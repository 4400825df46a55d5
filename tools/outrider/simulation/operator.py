"""Operator's ground station as a node: it sends orders to take off, fly to a goal, return and land."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import all as mavlink

from companion.values.components import COMPONENT
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import CommandAck, CommandInt, CommandLong, Source
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec

LINK = "ground"
_NAN = float("nan")
_RETRY_PERIOD_US = 500_000

_Key = tuple[int, int]


class _Open(NamedTuple):
    """Order that its companion has not accepted; it is sent again at ``due`` (µs).

    ``denied``: whether the companion has denied it.
    """

    order: CommandInt | CommandLong
    due: int
    denied: bool = False


class Operator:
    """Ground station that repeats every order each half second until the companion accepts it."""

    name = "operator"

    def __init__(self, fleet: FleetFrame) -> None:
        self._fleet = fleet
        self._source = Source(255, mavlink.MAV_COMP_ID_MISSIONPLANNER)
        self._codec = Codec()
        self._open: dict[_Key, _Open] = {}
        self._now = 0

    def take_off(self, system: int, height: float) -> None:
        """Order a climb to ``height`` (m) above the start, and then the escort."""
        params = (0.0, 0.0, 0.0, _NAN, _NAN, _NAN, height)
        self._order(CommandLong(self._source, system, COMPONENT, mavlink.MAV_CMD_NAV_TAKEOFF, 0, params))

    def land(self, system: int) -> None:
        """Order a landing on the spot; a pending order to take off is withdrawn."""
        self._open.pop((system, mavlink.MAV_CMD_NAV_TAKEOFF), None)
        params = (0.0, 0.0, 0.0, _NAN, _NAN, _NAN, 0.0)
        self._order(CommandLong(self._source, system, COMPONENT, mavlink.MAV_CMD_NAV_LAND, 0, params))

    def come_back(self, system: int) -> None:
        """Order a return to the start and a landing there; a pending order to take off is withdrawn."""
        self._open.pop((system, mavlink.MAV_CMD_NAV_TAKEOFF), None)
        command = mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH
        self._order(CommandLong(self._source, system, COMPONENT, command, 0, (0.0,) * 7))

    def goal(self, system: int, position: NDArray[np.float64]) -> None:
        """Order a flight to ``position`` (3,), fleet-local ENU."""
        latitude, longitude, altitude = self._fleet.to_geodetic(position)
        self._order(
            CommandInt(
                self._source,
                system,
                COMPONENT,
                mavlink.MAV_FRAME_GLOBAL,
                mavlink.MAV_CMD_DO_REPOSITION,
                (-1.0, 0.0, 0.0, _NAN),
                round(latitude * 1e7),
                round(longitude * 1e7),
                altitude,
            )
        )

    @property
    def unanswered(self) -> list[int]:
        """System ids, sorted, that have not yet accepted an order."""
        return sorted({system for system, _ in self._open})

    @property
    def refused_goals(self) -> list[int]:
        """System ids, sorted, whose companions denied the last goal and have not accepted it since."""
        goal = mavlink.MAV_CMD_DO_REPOSITION
        return sorted(s for (s, command), one in self._open.items() if command == goal and one.denied)

    def refusal(self, goals: Mapping[int, NDArray[np.float64]]) -> str | None:
        """Return which companions refused which of the ``goals`` (3,), m, by system id; None if none did."""
        refused = [
            f"vehicle {system} refused the goal ({', '.join(f'{x:.3f}' for x in goals[system])}) m"
            for system in self.refused_goals
        ]
        return "; ".join(refused) or None

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        """Remove accepted orders; send the new ones, and repeat those that are due."""
        self._now = now
        for datagram in inbox:
            for message in self._codec.feed(datagram.data):
                if isinstance(message, CommandAck):
                    self._learn((message.source.system, message.command), message.result)
        out = []
        for key, one in self._open.items():
            if now >= one.due:
                out.append(Datagram(LINK, self._codec.encode(one.order)))
                self._open[key] = one._replace(due=now + _RETRY_PERIOD_US)
        return out

    def _learn(self, key: _Key, result: int) -> None:
        """Note an answer; late ones of an order that was accepted or withdrawn change nothing."""
        if result == mavlink.MAV_RESULT_ACCEPTED:
            self._open.pop(key, None)
        elif result == mavlink.MAV_RESULT_DENIED and key in self._open:
            self._open[key] = self._open[key]._replace(denied=True)

    def _order(self, order: CommandInt | CommandLong) -> None:
        self._open[order.target_system, order.command] = _Open(order, self._now)
