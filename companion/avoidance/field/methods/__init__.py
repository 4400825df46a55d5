"""Ways out of the field's local minima (Sec. III-C): interchangeable strategies that see a scene and add
influence."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from companion.surfaces import Surface
from companion.values.horizon import Array
from companion.values.obstacles import Obstacles


class Scene(NamedTuple):
    """What one plan is made from: own state and prediction, target and obstacles, fleet-local ENU, SI.

    ``prediction`` (N + 1, 3) is the previous plan at n = 0…N from now; ``gradient`` the last ∇J (3,), zero at
    first. ``to_go`` (3,) leads from the vehicle to where its destination is *now*: in a moving formation what
    flies along with everybody is in nobody's way. ``target_end`` (3,) is where the target will be when the
    horizon ends, ``surface`` what the destination lies on around it, None for a goal of its own.
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
    """What a method changes: the field f (N + 1, 3), the factor on Ω_t, and the destination x̌ (3,)."""

    force: Array
    omega_scale: float
    destination: Array


class Method(Protocol):
    """One strategy; it may remember (latches), and belongs to one vehicle."""

    def influence(self, scene: Scene, influence: Influence) -> Influence:
        """The influence with this method's share added."""
        ...
