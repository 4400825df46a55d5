"""One vehicle with a tangential band, at the origin and on its way east unless said otherwise."""

from __future__ import annotations

import numpy as np

from companion.avoidance.field.methods import Influence, Scene
from companion.avoidance.field.methods.tangential import Tangential
from companion.config.planning import TangentialConfig
from tests.companion.rig import STRONG, ZERO

U_MAX, DT = 2.0, 0.1
NOTHING = Influence(np.zeros((16, 3)), 1.0, ZERO)


def method(sense="own", **settings):
    return Tangential(TangentialConfig(**settings), sense, U_MAX, DT)


def scene(others, to_go=(10.0, 0.0, 0.0), position=ZERO, velocity=ZERO, gradient=STRONG):
    to_go, position = np.asarray(to_go, dtype=float), np.asarray(position, dtype=float)
    prediction = position + DT * np.arange(16)[:, None] * velocity
    destination = position + to_go
    return Scene(
        position, velocity, prediction, destination, ZERO, to_go, ZERO, others, np.asarray(gradient), ZERO
    )


def force(*args, sense="own", **kwargs):
    """The force (3,) of a method that remembers nothing, and the factor on Ω_t."""
    influence = method(sense).influence(scene(*args, **kwargs), NOTHING)
    np.testing.assert_array_equal(influence.force, np.tile(influence.force[0], (16, 1)))
    return influence.force[0], influence.omega_scale
