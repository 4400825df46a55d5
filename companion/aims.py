"""Where to: the surface around the target, an own goal, or where to stay, to land, or to come back to."""

from __future__ import annotations

import numpy as np

from companion.bearings import turned
from companion.config import CompanionConfig
from companion.forces import Obstacles
from companion.horizon import Array, Motion
from companion.pilot import Phase, Pilot
from companion.planner import Aim, standing
from companion.settling import Settling
from companion.tracks import State
from companion.world import View

_BACK, _STILL = 0.5, 0.5
"""m and m/s: so near to where it started, and so slow, it is back."""


class Aims:
    """Of the vehicle of ``system``. The ``pilot`` is asked for its phase, and told when the vehicle is back,
    and when it has settled. ``seconds``: how far ahead a plan ends."""

    def __init__(self, config: CompanionConfig, system: int, pilot: Pilot, seconds: float) -> None:
        self._config = config
        self._pilot = pilot
        self._seconds = seconds
        self._surface = config.surface_of(system)
        self._settling = Settling(config)
        self._held: Array | None = None
        self.goal: Array | None = None
        """(3,) m, fleet-local ENU: of the task ``goto``; None for where it is."""

    def forget(self, view: View) -> None:
        """Once it escorts again, it stays elsewhere the next time."""
        if self._pilot.phase not in (Phase.HOLD, Phase.RETURN) and view.target is not None:
            self._held = None

    def aim(self, view: View, measured: Motion, obstacles: Obstacles, *, cautious: bool) -> Aim:
        """For a plan from ``measured`` on, ``cautious`` no further than that speed goes; ``obstacles``: as
        planned among last, of which it settles clear. SurfaceError where the surface has no nearest point."""
        aim = self._destination(view, measured, obstacles)
        speed = self._config.guard.cautious_speed
        return aim if speed is None or not cautious else self._shortened(aim, measured, speed)

    def _shortened(self, aim: Aim, measured: Motion, speed: float) -> Aim:
        """The same way, but no further in a horizon than ``speed`` goes."""
        drift = aim.target_end - aim.target
        way = aim.destination - drift - measured.position
        far = float(np.linalg.norm(way))
        most = speed * 1e-6 * self._config.horizon.dt_us * (self._config.horizon.steps + 1)
        if far <= most:
            return aim
        return aim._replace(destination=measured.position + drift + most / far * way)

    def _destination(self, view: View, measured: Motion, obstacles: Obstacles) -> Aim:
        target, phase, task = view.target, self._pilot.phase, self._config.task
        if phase is Phase.RETURN:
            place = self._way_back(measured)
        elif phase is Phase.SETTLE:
            place = self._settling.rest(measured, obstacles)
            if self._settling.clear:
                self._pilot.settled()
        elif phase is not Phase.HOLD and task == "goto":
            place = measured.position if self.goal is None else self.goal
        elif phase is not Phase.HOLD and target is not None:
            return self._around(target, measured)
        else:
            # Told to, or because nobody is there to be stood around: where it is, clear of the others.
            place = self._place_to_hold(measured)
        return standing(place, None if target is None else target.position)

    def _around(self, target: State, measured: Motion) -> Aim:
        """The surface around the target where that will be at the end of the horizon."""
        ahead, rate, surface = self._seconds, self._config.turn_rate, self._surface
        (end,), (velocity,) = target.ahead(np.array([ahead]))
        offset = surface.nearest(measured.position - target.position)
        if rate:
            offset = surface.nearest(turned(offset, rate * ahead))
            velocity = velocity + rate * np.array([-offset[1], offset[0], 0.0])
        return Aim(end + offset, velocity, target.position, end, surface)

    def _place_to_hold(self, measured: Motion) -> Array:
        """Where it was when it was told to stay or to come back, or when the target was lost."""
        if self._held is None:
            self._held = measured.position.copy()
        return self._held

    def _way_back(self, measured: Motion) -> Array:
        """Above where it started, as high as it flies now and allowed; told to the pilot when it is there."""
        limits, start = self._config.limits, self._pilot.start
        if start is None:
            return measured.position
        height = float(self._place_to_hold(measured)[2])
        height = min(max(height, limits.box_min[2]), limits.box_max[2])
        above = np.array([start[0], start[1], height])
        off = above - measured.position
        if float(off[:2] @ off[:2]) < _BACK**2 and float(measured.velocity @ measured.velocity) < _STILL**2:
            self._pilot.returned()
        return above
