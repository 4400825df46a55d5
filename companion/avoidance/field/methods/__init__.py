"""Methods against the field's local minima (Sec. III-D): each takes a scene and adds to the influence.

They are interchangeable strategies.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

from companion.surfaces import Surface
from companion.values.horizon import Array
from companion.values.obstacles import Obstacles


class Scene(NamedTuple):
    """Inputs of one plan: own state and prediction, target and obstacles, fleet-local ENU, SI.

    ``prediction`` (N + 1, 3) is the previous plan at n = 0…N from now; ``gradient`` (3,) is the last ∇J, zero
    at first. ``to_go`` (3,) leads from the vehicle to where its destination is *now*, not at the end of the
    horizon: the common motion of a formation then does not make one vehicle an obstacle on the way of
    another. ``target_end`` (3,) is the target's position at the end of the horizon. ``surface`` is the
    surface around the target that the destination lies on; None if the destination is a goal without a
    surface.
    """

    position: Array
    velocity: Array
    prediction: Array
    destination: Array
    destination_velocity: Array
    to_go: Array
    target: Array
    obstacles: Obstacles
    gradient: Array
    target_end: Array
    surface: Surface | None = None


class Influence(NamedTuple):
    """Changes by the methods: the field f (N + 1, 3), m/s², the factor on Ω_t, the destination x̌ (3,), m."""

    force: Array
    omega_scale: float
    destination: Array


class Method(Protocol):
    """Strategy of one vehicle; it may keep state (latches)."""

    def influence(self, scene: Scene, influence: Influence) -> Influence:
        """Return the influence with this method's share added."""
        ...
