"""What a camera may see: the tracked object, and what may hide it.

Motion comes as HIL_STATE_QUATERNION (115), the ground truth of simulations, on the link ``sight``: one sender
for each body, stamped with the time of the simulation's steps.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy.typing as npt

from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import HilState, Source
from sitl.camera.occlusion import Body, Point

LINK: Final = "sight"
"""Link of the ground truth that cameras see."""

_KEPT_US: Final = 8_000_000
_BEYOND_US: Final = 100_000
# A longer silence than this ends a body's motion: it is not there any more.


class Scene(NamedTuple):
    """Bodies by the system ids of their senders.

    ``target``: the tracked object; None: nothing to track. ``fixed``: bodies that do not move, site NED.
    ``moving``: shapes of the other senders, with their place at the origin.
    """

    target: int | None = None
    fixed: tuple[Body, ...] = ()
    moving: Mapping[int, Body] = {}


def truth(source: Source, time: int, place: npt.ArrayLike, frame: FleetFrame) -> HilState:
    """Return the message that ``source`` is at ``place`` (3,), m, ENU of ``frame``, at ``time`` (µs)."""
    return HilState(source, time, *frame.to_geodetic(place), (0.0, 0.0, 0.0))


class Sightings:
    """True positions of the senders, interpolated."""

    def __init__(self, scene: Scene, site: FleetFrame) -> None:
        self.scene = scene
        self._site = site
        known = set(scene.moving) | ({scene.target} if scene.target is not None else set())
        self._places: dict[int, deque[tuple[int, Point]]] = {system: deque() for system in sorted(known)}

    def receive(self, message: HilState) -> None:
        """Receive the place of a body; bodies that are not of the scene are ignored."""
        places = self._places.get(message.source.system)
        if places is None or (places and message.time <= places[-1][0]):
            return
        east, north, up = self._site.to_east_north_up(message.latitude, message.longitude, message.altitude)
        places.append((message.time, (north, east, -up)))
        while places[0][0] < message.time - _KEPT_US:
            places.popleft()

    def place(self, system: int, time: int) -> Point | None:
        """Return where the body of ``system`` was at ``time`` (µs), site NED (m).

        Between messages the place is interpolated, and for ``_BEYOND_US`` after the last one extrapolated.
        Returns None before the first one, and later.
        """
        after: tuple[int, Point] | None = None
        # Images are of a moment ago: from the newest on.
        for one in reversed(self._places.get(system, ())):
            if one[0] < time:
                break
            after = one
        else:
            return after[1] if after is not None and after[0] == time else None
        if after is None:
            return self._beyond(system, time)
        if after[0] == time:
            return after[1]
        if after[0] - one[0] > _BEYOND_US:
            return None
        return _between(one, after, time)

    def bodies(self, time: int) -> list[Body]:
        """Return all bodies that may hide the target at ``time`` (µs)."""
        found = list(self.scene.fixed)
        for system, shape in self.scene.moving.items():
            place = self.place(system, time)
            if place is not None and system != self.scene.target:
                found.append(shape.moved(place))
        return found

    def _beyond(self, system: int, time: int) -> Point | None:
        places = self._places.get(system, deque())
        if not places or time - places[-1][0] > _BEYOND_US:
            return None
        if len(places) < 2:
            return places[-1][1]
        return _between(places[-2], places[-1], time)


def _between(before: tuple[int, Point], after: tuple[int, Point], time: int) -> Point:
    share = (time - before[0]) / (after[0] - before[0])
    (a, b, c), (x, y, z) = before[1], after[1]
    return a + share * (x - a), b + share * (y - b), c + share * (z - c)
