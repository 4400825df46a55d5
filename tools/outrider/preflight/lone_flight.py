"""Flight of one vehicle alone, by a companion with committed plans, which measures its tube and its drift.

    go → take-off → the places of the course → land → tracking error, drift

The companion is that of ``outrider fly``: all conditions of a start and all reactions to faults are its own.
It hears no other vehicle, so the fleet of its plans is the vehicle alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from time import thread_time_ns
from typing import Final

import numpy as np
from pymavlink.dialects.v20 import all as mavlink

from companion.config import CompanionConfig
from companion.flight.readiness import OPERATORS_GO
from companion.node import Companion
from companion.values.components import COMPONENT
from companion.values.horizon import Array
from companion.values.phase import STEERED, Phase
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import CommandInt, Heartbeat, Source
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.signing import Signing
from outrider.onboard.orders import OPERATOR, Orders
from outrider.preflight.course import Box, outside
from outrider.preflight.drift import DriftMeter
from outrider.preflight.tube import TrackingError, TrackingMeter

_REPEAT_US: Final = 1_000_000
"""Time between two equal orders, µs."""
_START_US: Final = 60_000_000
"""Longest time from the go to the end of the climb, µs."""
_LEG_US: Final = 40_000_000
"""Longest time of one leg of the course, µs."""
_LAND_US: Final = 120_000_000
"""Longest time from the order to land to the ground, µs."""
_NEAR_M, _SLOW_M_S = 0.5, 0.3
"""Distance (m) from a place and speed (m/s) with which a leg is over."""
_SETTLED_US: Final = 1_000_000
"""Time for which the vehicle is there, µs."""
_OURS: Final = (Phase.PREPARE, *STEERED, Phase.LAND)


def settings_of(config: CompanionConfig) -> CompanionConfig:
    """Return the settings of a flight alone: committed plans without others, on the own clock."""
    certified = config.certified.model_copy(update={"fleet": (), "fleet_time": "own"})
    changes = {"avoidance": "certified", "task": "goto", "certified": certified, "target_d_min": None}
    return config.model_copy(update={**changes, "target_d_safe": None, "obstacles": config.obstacles})


class LoneFlight:
    """Flight of ``system``, once ``step`` is called; ``height`` (m): of the take-off, above the ground.

    ``trouble``: why the flight does not count, empty as long as it does. ``signing``: of this flight alone.
    """

    def __init__(
        self,
        config: CompanionConfig,
        system: int,
        target: int,
        frame: FleetFrame,
        height: float,
        box: Box,
        signing: Signing | None = None,
    ) -> None:
        self._config, self._system, self._frame = settings_of(config), system, frame
        self._height, self._box, self._signing = height, box, signing
        # Orders pass from here to the companion: on its ground link, which is no link of this process.
        self._ordering = None if signing is None else Signing(signing.key)
        self._orders = Orders(system, height, self._ordering)
        self._companion = Companion(self._config, system, target, frame, thread_time_ns, signing)
        self._meter = TrackingMeter(system, planar=config.planar, lead=config.setpoint_lead_us)
        self._drift = DriftMeter()
        self.trouble = ""
        self._places: list[Array] | None = None
        self._leg = -1
        self._began: int | None = None
        self._leg_began = self._next_order = 0
        self._there: int | None = None
        self._landing: int | None = None
        self._gone = self._armed = self._complete = self._gave_up = False

    @property
    def over(self) -> bool:
        """Whether the flight has ended: landed, not begun, or in the hands of another controller."""
        phase = self._companion.pilot.phase
        return self._gave_up or phase in (Phase.DONE, Phase.YIELDED)

    @property
    def controls(self) -> bool:
        """Whether the companion controls the vehicle, which may be in the air."""
        return self._companion.pilot.phase in _OURS

    @property
    def heartbeat(self) -> Heartbeat | None:
        """Last heartbeat of the autopilot."""
        return self._companion.pilot.vehicle.heartbeat

    @property
    def doing(self) -> str:
        """Description of what it does now."""
        pilot = self._companion.pilot
        if pilot.phase is Phase.CONNECT:
            return f"waiting for {pilot.waiting_for or 'the start'}"
        if self._places is not None and 0 <= self._leg < len(self._places) and self._landing is None:
            return f"flying leg {self._leg + 1} of {len(self._places)}"
        return str(pilot.phase.value)

    @property
    def result(self) -> TrackingError:
        """The tracking error so far."""
        return self._meter.result

    @property
    def drift(self) -> float | None:
        """Largest distance (m) from the axis of its column in take-off and landing; None before them."""
        return self._drift.largest

    def stop(self, now: int, why: str) -> None:
        """Land because of ``why``; the flight does not count."""
        self.trouble = self.trouble or why
        self._land(now)

    def step(self, now: int, inbox: Sequence[bytes]) -> list[bytes]:
        """Step the companion with what has arrived of its autopilot; return what is to be sent to it."""
        self._began = now if self._began is None else self._began
        if self._signing is not None:
            self._signing.present(now)
        if self._ordering is not None:
            self._ordering.present(now)
        orders = self._lead(now)
        given = [Datagram("autopilot", data) for data in inbox]
        given += [Datagram("ground", data) for data in orders]
        sent = [one.data for one in self._companion.step(now, given) if one.link == "autopilot"]
        for data in (*inbox, *sent):
            self._meter.receive(now, data)
        own = self._companion.world.at(now).own
        if own is not None:
            self._drift.see(self._companion.pilot.phase, own.position)
        if self._companion.pilot.phase is Phase.YIELDED:
            self.trouble = self.trouble or "a pilot or another controller has the vehicle"
        elif self.over and not self._complete:
            self.trouble = self.trouble or "the course was not flown to its end"
        return sent

    def _lead(self, now: int) -> list[bytes]:
        """Return the orders that are due, by what the companion does."""
        pilot = self._companion.pilot
        phase = pilot.phase
        if self.over:
            return []
        if self._landing is not None:
            return self._until_landed(now, phase)
        if phase in (Phase.CONNECT, Phase.PREPARE):
            return self._start(now, phase)
        if phase is not Phase.ESCORT:
            self.stop(now, self._reason())
            return self._until_landed(now, phase)
        return self._fly(now)

    def _start(self, now: int, phase: Phase) -> list[bytes]:
        """Order the take-off once all else is ready and the course is inside the box."""
        pilot = self._companion.pilot
        since = 0 if self._began is None else now - self._began
        if since > _START_US:
            self.trouble = f"it did not take off: {pilot.waiting_for or 'no reason is known'}"
            if phase is Phase.PREPARE:
                self._land(now)
                return self._until_landed(now, phase)
            self._gave_up = True
            return []
        if self._gone and phase is Phase.CONNECT and self._armed:
            # Another go would be another decision.
            self.trouble, self._gave_up = "the take-off was broken off", True
        self._armed = phase is Phase.PREPARE
        if self._gone or pilot.waiting_for != OPERATORS_GO:
            return []
        own = self._companion.world.at(now).own
        if own is None:
            return []
        corner = own.position + np.array([0.0, 0.0, self._height])
        if trouble := outside([corner, *self._box.places(corner)], self._config.limits):
            self.trouble, self._gave_up = trouble, True
            return []
        self._gone = True
        return [self._orders.frame("go")]

    def _fly(self, now: int) -> list[bytes]:
        """Order the next place once the vehicle is at the last one; land after all."""
        own = self._companion.world.at(now).own
        if own is None:
            return []
        if self._places is None:
            # The corner is the place above the start where the companion began to steer.
            self._places, self._leg, self._leg_began = self._box.places(own.position), 0, now
        place = self._places[self._leg]
        if now - self._leg_began > _LEG_US:
            self.stop(now, f"leg {self._leg + 1} took more than {1e-6 * _LEG_US:.0f} s")
            return []
        near = np.linalg.norm(own.position - place) < _NEAR_M
        slow = np.linalg.norm(own.velocity) < _SLOW_M_S
        self._there = (now if self._there is None else self._there) if near and slow else None
        if self._there is not None and now - self._there >= _SETTLED_US:
            self._leg, self._leg_began, self._there = self._leg + 1, now, None
            if self._leg == len(self._places):
                self._complete = True
                self._check()
                self._land(now)
                return []
            self._next_order = now
            place = self._places[self._leg]
        if now < self._next_order:
            return []
        self._next_order = now + _REPEAT_US
        return [self._reposition(place)]

    def _check(self) -> None:
        """Note a plan that began anew: the vehicle was further from it than ``guard.tube``."""
        if self._companion.tally.anchored_anew:
            self.trouble = f"it was more than guard.tube, {self._config.guard.tube:g} m, from its plan"

    def _until_landed(self, now: int, phase: Phase) -> list[bytes]:
        if self._landing is not None and now - self._landing > _LAND_US:
            self.trouble, self._gave_up = self.trouble or "it did not land", True
            return []
        if phase is Phase.CONNECT:
            # It had not taken off.
            self._gave_up = True
            self._companion.pilot.take_back()
            return []
        if phase in (Phase.LAND, Phase.SETTLE) or now < self._next_order:
            return []
        self._next_order = now + _REPEAT_US
        return [self._orders.frame("land")]

    def _land(self, now: int) -> None:
        if self._landing is None:
            self._landing = self._next_order = now

    def _reason(self) -> str:
        """Return why the companion ends the flight by itself."""
        concerns = [concern.text for concern in self._companion.health.concerns.values()]
        return "; ".join(concerns) or f"phase {self._companion.pilot.phase.value}"

    def _reposition(self, place: Array) -> bytes:
        latitude, longitude, altitude = self._frame.to_geodetic(place)
        source, frame = Source(self._system, OPERATOR), mavlink.MAV_FRAME_GLOBAL
        x, y = round(1e7 * latitude), round(1e7 * longitude)
        command = mavlink.MAV_CMD_DO_REPOSITION
        order = CommandInt(
            source, self._system, COMPONENT, frame, command, (0.0, 0.0, 0.0, 0.0), x, y, altitude
        )
        return self._orders.encode(order)
