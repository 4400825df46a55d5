"""Colours of all pictures: report, view, exports and matplotlib figures."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

RGB = tuple[int, int, int]
_P = ParamSpec("_P")
_R = TypeVar("_R")


def rgb(code: str) -> RGB:
    """Return the RGB values of #rrggbb."""
    return int(code[1:3], 16), int(code[3:5], 16), int(code[5:7], 16)


# Distinguishable with colour blindness, too (M. Petroff, Accessible Color Sequences, 2021).
VEHICLES = (
    "#3f90da",
    "#ffa90e",
    "#bd1f01",
    "#94a4a2",
    "#832db6",
    "#a96b59",
    "#e76300",
    "#b9ac70",
    "#717581",
    "#92dadd",
)
TARGET, OBSTACLE, LIMIT = "#404040", "#999999", "#b3261e"
"""Colours of the target, of obstacles and bystanders, and of limits."""
INK, SOFT, LINE, GRID, BAD, ACCENT, SOLID = map(
    rgb, ("#17202a", "#5b6773", "#d5dbe1", "#e3e8ec", LIMIT, "#1f5fae", "#aab4bd")
)


def hex_of(k: int) -> str:
    """Return the colour of vehicle ``k`` as #rrggbb."""
    return VEHICLES[k % len(VEHICLES)]


def colours(count: int) -> NDArray[np.uint8]:
    """Return the colours (count, 3) of ``count`` vehicles."""
    return np.array([rgb(hex_of(k)) for k in range(count)], dtype=np.uint8).reshape(-1, 3)


def linear(colour: RGB | NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return sRGB (…, 3) as linear intensities.

    The browser program of viser expects linear intensities for the colours of batched meshes and of vertices;
    the one colour of a single mesh is sRGB.
    """
    share = np.asarray(colour) / 255.0
    found = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    return np.rint(255.0 * found).astype(np.uint8)


def coloured(draw: Callable[_P, _R]) -> Callable[_P, _R]:
    """Decorate a function that draws with matplotlib: its colours C0, C1 … are those of the vehicles."""

    @wraps(draw)
    def drawn(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        import matplotlib
        from cycler import cycler

        with matplotlib.rc_context({"axes.prop_cycle": cycler(color=VEHICLES)}):
            return draw(*args, **kwargs)

    return drawn
