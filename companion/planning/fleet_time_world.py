"""The world picture in fleet time, for plans whose knots are in fleet time.

The picture itself is in the companion's own time, because it dates messages by their arrival.
"""

from __future__ import annotations

from collections.abc import Set

from companion.avoidance.certified.fleet_clock import FleetClock
from companion.obstacles.static import Axes
from companion.values.horizon import Array
from companion.world import World


class _Neighbours:
    """Neighbours of ``world``, with times of ``clock``."""

    def __init__(self, world: World, clock: FleetClock) -> None:
        self._neighbours, self._clock = world.neighbours, clock

    def last_received(self, without: Set[int] = frozenset()) -> list[tuple[int, int, Array, Array]]:
        """Return ``Neighbours.last_received`` in fleet time."""
        return self._in_fleet_time(self._neighbours.last_received(without))

    def turn_rates(self) -> dict[int, float]:
        """Return ``Neighbours.turn_rates``."""
        return self._neighbours.turn_rates()

    def as_arrived(self) -> list[tuple[int, int, Array, Array]]:
        """Return ``Neighbours.as_arrived`` in fleet time."""
        return self._in_fleet_time(self._neighbours.as_arrived())

    def _in_fleet_time(
        self, states: list[tuple[int, int, Array, Array]]
    ) -> list[tuple[int, int, Array, Array]]:
        ahead = self._clock.ahead or 0
        return [(system, time + ahead, position, velocity) for system, time, position, velocity in states]


class _Sensed:
    """Sensed obstacles of ``world``, asked in times of ``clock``."""

    def __init__(self, world: World, clock: FleetClock) -> None:
        self._sensed, self._clock = world.sensed, clock

    def around(self, now: int, prediction: Array, reach: float) -> Axes:
        """Return ``Sensed.around`` at ``now`` (µs, fleet time)."""
        return self._sensed.around(now - (self._clock.ahead or 0), prediction, reach)


class FleetTimeWorld:
    """The ``world`` in the fleet time of ``clock``.

    It has only what constraints of a plan are made of; whatever else they ask for raises AttributeError,
    because it would be in the wrong time.
    """

    def __init__(self, world: World, clock: FleetClock) -> None:
        self.neighbours = _Neighbours(world, clock)
        self.sensed = _Sensed(world, clock)
