"""Target of a trial: it follows its path, reports its position, and can fall silent or stop."""

from __future__ import annotations

import random
from typing import Protocol

import numpy as np

from mavlink_bridge.clocks.clock import WallClock
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.links.opening import open_link
from outrider.resources import find
from outrider.scenarios.places import PathTarget
from outrider.scenarios.scenario import Scenario
from outrider.simulation.beacon import Beacon
from outrider.simulation.paths import ClosedPath, Motion, Walk
from outrider.yaml_files.yaml_file import load
from trials.plan import HOST, SORTIE, TARGET

_RADIUS, _TURN, _RATE = 8.0, 0.1, 5.0
"""m, rad/s, Hz; the speed is 0.8 m/s, a walk."""
_MIDDLE = np.array([3.0, 1.5, 0.0])
"""Centre (m), that of the grid on which the vehicles start: the target never walks among them."""


class TargetPath(Protocol):
    """Path of a target over time (µs)."""

    def begin(self, now: int) -> None:
        """Start the motion at ``now``."""
        ...

    def motion(self, now: int) -> Motion:
        """Return position and velocity at ``now``."""
        ...


class Circle:
    """Circle, in motion from the beginning."""

    def begin(self, now: int) -> None:
        """Do nothing: it is already in motion."""

    def motion(self, now: int) -> Motion:
        """Return position and velocity at ``now``."""
        angle = _TURN * 1e-6 * now
        place = _MIDDLE + _RADIUS * np.array([np.sin(angle), np.cos(angle), 0.0])
        return Motion(place, _RADIUS * _TURN * np.array([np.cos(angle), -np.sin(angle), 0.0]))


def sortie_target() -> PathTarget:
    """Return the target of the scenario ``sortie``."""
    target = load(find("scenarios", SORTIE), Scenario).target
    if not isinstance(target, PathTarget):
        raise TypeError(f"the target of {SORTIE} has no path")
    return target


def sortie_way() -> Walk:
    """Return that target's path: it stands, walks, and runs."""
    target = sortie_target()
    paces = [(pace.after_s, pace.speed) for pace in target.paces]
    return Walk(ClosedPath(np.array(target.through)), target.speed, target.setting_out, paces)


class Walker:
    """Target that reports its position to all who receive at ``endpoint``; times are in µs."""

    def __init__(self, fleet: FleetFrame, way: TargetPath) -> None:
        self.silent = False
        # A random group: several trials may run at the same time.
        group = f"239.255.{random.randrange(1, 250)}.{random.randrange(1, 250)}"
        self.endpoint = f"mcast:{group}:{random.randrange(16_000, 28_000)},{HOST}"
        self._link = open_link(self.endpoint, WallClock())
        self._way = way
        self._stopped: Motion | None = None
        self.boot = 0
        """Time of its first step (µs), to which its time stamps are relative."""
        self._beacon = Beacon(TARGET, "target", _RATE, fleet)

    def begin(self, now: int) -> None:
        """Start the motion at ``now``."""
        self._way.begin(now)

    def stop(self, now: int) -> None:
        """Stop, from ``now`` on."""
        self._stopped = Motion(self._way.motion(now).position, np.zeros(3))

    def motion(self, now: int) -> Motion:
        """Return position and velocity at ``now``."""
        return self._way.motion(now) if self._stopped is None else self._stopped

    def turn(self, now: int) -> None:
        """Send the message that is due at ``now``, unless silent."""
        self.boot = self.boot or now
        if self._beacon.due(now) and not self.silent:
            for datagram in self._beacon.say(now, self.motion(now)):
                self._link.send(datagram.data)

    def close(self) -> None:
        """Close the link."""
        self._link.close()
