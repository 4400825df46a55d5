"""User-defined surface: a Python function of two parameters.

Another installed package offers the function as an entry point of the group ``outrider.surfaces``; a
configuration can name no other code. The function takes arrays u and v (n,) in 0…1,
and the ``parameters`` of the configuration as keywords. It returns offsets (n, 3) from the target,
fleet-local ENU, m, and must be continuous.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from importlib.metadata import entry_points
from typing import Any, Literal

import numpy as np
from pydantic import Field, model_validator

from companion.errors import SurfaceError
from companion.values.horizon import Array
from companion.values.settings import Settings

GROUP = "outrider.surfaces"
_GRID = 48
_SEARCH_OFFSETS = np.linspace(-1.0, 1.0, 7)
_ROUNDS = 9
"""Number of search rounds; each narrows the step to a third, to 1e-6 of the parameters' range at the end."""

Function = Callable[..., Any]


class Parametric(Settings):
    """Surface of the points of a function of u and v."""

    kind: Literal["parametric"]
    function: str = Field(min_length=1, max_length=200, description=f"an entry point of {GROUP}")
    parameters: dict[str, float] = Field(
        default_factory=dict, max_length=20, description="numbers that the function gets as keywords"
    )

    @model_validator(mode="after")
    def _usable(self) -> Parametric:
        try:
            _grid(self._function_key)
        except SurfaceError as error:
            raise ValueError(error) from error
        return self

    def nearest(self, offset: Array) -> Array:
        """Return the nearest points by search: on a grid, then on finer and finer grids around the best.

        Raises SurfaceError if the function fails.
        """
        flat = offset.reshape(-1, 3)
        return np.array([self._nearest(one) for one in flat]).reshape(offset.shape)

    def outline(self) -> Array:
        """Return the line at v = 0.5."""
        u = np.linspace(0.0, 1.0, 73)
        return _points(self._function_key, u, np.full(len(u), 0.5))

    def _nearest(self, offset: Array) -> Array:
        name = self._function_key
        uv, points = _grid(name)
        best = int(np.argmin(np.sum((points - offset) ** 2, axis=1)))
        (u, v), step = uv[best], 1.0 / _GRID
        point: Array = points[best]
        for _ in range(_ROUNDS):
            us = np.clip(u + step * _SEARCH_OFFSETS, 0.0, 1.0)
            vs = np.clip(v + step * _SEARCH_OFFSETS, 0.0, 1.0)
            around = np.stack(np.meshgrid(us, vs, indexing="ij"), axis=-1).reshape(-1, 2)
            candidates = _points(name, around[:, 0], around[:, 1])
            best = int(np.argmin(np.sum((candidates - offset) ** 2, axis=1)))
            (u, v), point = around[best], candidates[best]
            step /= 3.0
        return point

    @property
    def _function_key(self) -> tuple[str, tuple[tuple[str, float], ...]]:
        return self.function, tuple(sorted(self.parameters.items()))


_FunctionKey = tuple[str, tuple[tuple[str, float], ...]]


@lru_cache(maxsize=64)
def _function(name: str) -> Function:
    found = entry_points(group=GROUP)
    if name not in found.names:
        known = ", ".join(sorted(found.names)) or "none; none is installed"
        raise SurfaceError(f"{name!r} is no entry point of {GROUP}; allowed: {known}")
    try:
        loaded: Function = found[name].load()
    except (ImportError, AttributeError) as error:
        raise SurfaceError(f"{name!r} of {GROUP} cannot be loaded: {error}") from error
    return loaded


def _points(name: _FunctionKey, u: Array, v: Array) -> Array:
    """Return points (n, 3), m, of the function; raises SurfaceError if it fails or returns anything else."""
    function, parameters = _function(name[0]), dict(name[1])
    try:
        points = np.asarray(function(u, v, **parameters), dtype=np.float64)
    except Exception as error:  # a user's code may raise anything; the error tells what
        raise SurfaceError(f"{name[0]} failed: {type(error).__name__}: {error}") from error
    if points.shape != (len(u), 3):
        raise SurfaceError(f"{name[0]} gives an array {points.shape}; allowed is ({len(u)}, 3)")
    if not np.isfinite(points).all():
        raise SurfaceError(f"{name[0]} gives points that are not finite")
    return points


@lru_cache(maxsize=64)
def _grid(name: _FunctionKey) -> tuple[Array, Array]:
    """Return parameters (n, 2) and points (n, 3), m, of the grid on which a search starts."""
    line = np.linspace(0.0, 1.0, _GRID + 1)
    uv = np.stack(np.meshgrid(line, line, indexing="ij"), axis=-1).reshape(-1, 2)
    return uv, _points(name, uv[:, 0], uv[:, 1])
