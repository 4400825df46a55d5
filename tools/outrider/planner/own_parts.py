"""Parts of a planner that its caller supplies: a surface around the target, and methods of the field."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from companion.avoidance.field.methods import Influence, Method, Scene
from companion.avoidance.field.planner import Aim, Planner, build, standing
from companion.config import CompanionConfig
from companion.config.planning import LimitsConfig, MethodName
from companion.flight.state_machine import Pilot
from companion.goals.goals import Goals
from companion.values.horizon import Array, Motion
from companion.values.mates import Mates, Sight
from companion.values.obstacles import Obstacles
from companion.world import View
from outrider.arguments import checked

TARGET = 0
"""Id of the target among obstacles; no vehicle has it."""


class OwnSurface(Protocol):
    """Surface around a target: anything that gives its nearest point."""

    def nearest(self, offset: Array) -> ArrayLike:
        """Return the point (3,) of the surface nearest to ``offset`` (3,) from the target, m, ENU."""
        ...


class _CheckedSurface:
    """``OwnSurface`` whose answers are checked, for offsets (…, 3)."""

    def __init__(self, surface: OwnSurface) -> None:
        self._surface = surface

    def nearest(self, offset: Array) -> Array:
        """Return the nearest points (…, 3), m. Raises InputError for a wrong answer."""
        points = [
            checked("nearest() of the surface", self._surface.nearest(one), (3,), "m from the target")
            for one in offset.reshape(-1, 3)
        ]
        return np.array(points).reshape(offset.shape)

    def outline(self) -> Array:
        """Return the points (73, 3) nearest to a wide level circle, m."""
        angle = np.linspace(0.0, 2.0 * np.pi, 73)
        return self.nearest(100.0 * np.stack([np.cos(angle), np.sin(angle), np.zeros(73)], axis=1))


class OwnGoals(Goals):
    """Destinations of the caller: ``goal`` if there is one, otherwise on a surface around the target.

    ``surface`` is the caller's; None: the configured one.
    """

    def __init__(
        self,
        config: CompanionConfig,
        system: int,
        pilot: Pilot,
        lookahead_s: float,
        surface: OwnSurface | None,
    ) -> None:
        super().__init__(config.model_copy(update={"task": "escort"}), system, pilot, lookahead_s, TARGET)
        if surface is not None:
            self._surface = _CheckedSurface(surface)

    def _destination(
        self, now: int, view: View, measured: Motion, obstacles: Obstacles, mates: Mates, sight: Sight
    ) -> Aim:
        if self.goal is None:
            return super()._destination(now, view, measured, obstacles, mates, sight)
        # Without goal and target the vehicle holds the position where both ended.
        self._held = None
        return standing(self.goal, None if view.target is None else view.target.position)


class _CheckedMethod:
    """Method of the caller whose influence is checked."""

    def __init__(self, method: Method) -> None:
        self._method = method

    def influence(self, scene: Scene, influence: Influence) -> Influence:
        """Return the method's influence. Raises InputError for wrong shapes and values."""
        force, omega_scale, destination = self._method.influence(scene, influence)
        name = type(self._method).__name__
        return Influence(
            checked(f"force of {name}", force, scene.prediction.shape, "m/s²"),
            float(checked(f"omega_scale of {name}", omega_scale, (), "1")),
            checked(f"destination of {name}", destination, (3,), "m"),
        )


class OwnMethods(Planner):
    """Planner of the field with the configured methods, followed by the caller's ``methods``."""

    def __init__(self, config: CompanionConfig, methods: Sequence[Method]) -> None:
        super().__init__(config)
        self._own = [_CheckedMethod(method) for method in methods]
        self._join()

    def use(self, methods: tuple[MethodName, ...]) -> None:
        """Use ``methods``, followed by the caller's own, from the next plan on."""
        super().use(methods)
        self._join()

    def keep(self, limits: LimitsConfig) -> None:
        """Keep other ``limits`` from the next plan on."""
        super().keep(limits)
        self._join()

    def _join(self) -> None:
        self._methods = [*build(self.config), *self._own]
