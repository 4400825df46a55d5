"""Vehicles that share a surface, and what is known of the target beside its state."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from companion.values.horizon import Array

_NO_POSITIONS = np.empty((0, 3))
_NO_POSITIONS.flags.writeable = False


class Mates(NamedTuple):
    """Other vehicles that fly by plans of their own: system ids (M,), positions (M, 3), m, ENU."""

    ids: tuple[int, ...] = ()
    positions: Array = _NO_POSITIONS


class Sight(NamedTuple):
    """What the fusion of detections knows beside the target's state.

    ``weights``: w_k (1/m²) of each vehicle as measured, by system id, that of a vehicle that does not see the
    target 0; empty without fusion. ``prior``: s₀ (1/m²), the anisotropy of the information on the target's
    place that is left at the end of the horizon without another detection.
    """

    weights: Mapping[int, float] = MappingProxyType({})
    prior: complex = 0j
