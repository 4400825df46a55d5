"""Colours of all pictures: report, view, exports and matplotlib figures.

Marks (vehicles, target, solids) have the same colour everywhere: a contrast of at least 3:1 with light and
with dark grounds. Text in a vehicle's colour is darker or lighter than its mark, so that its contrast is at
least 4.5:1 (WCAG 2.2, 1.4.3 and 1.4.11).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cache, wraps
from typing import ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

RGB = tuple[int, int, int]
_P = ParamSpec("_P")
_R = TypeVar("_R")


def rgb(code: str) -> RGB:
    """Return the RGB values of #rrggbb."""
    return int(code[1:3], 16), int(code[3:5], 16), int(code[5:7], 16)


# Found by a random search for the largest least distance of two, in Oklab, with normal vision and with the
# three kinds of colour blindness, among colours that have 3:1 on all grounds.
VEHICLES = (
    "#2e8ff9",
    "#f25f0f",
    "#a13ccb",
    "#30a03d",
    "#bf3763",
    "#9a5d08",
    "#bf4aa6",
    "#5254ff",
    "#749585",
    "#36757f",
)
TARGET, OBSTACLE, BYSTANDER, LIMIT = "#e154d1", "#84898e", "#74808c", "#b3261e"
"""Colours of the target, of obstacles, of vehicles without the task, and of limits on a light ground."""
LIGHT = {
    "paper": "#ffffff",
    "panel": "#f4f6f8",
    "sky": "#f7f9fb",
    "ink": "#17202a",
    "soft": "#5b6773",
    "line": "#d5dbe1",
    "grid": "#e3e8ec",
    "good": "#0b6e4f",
    "bad": "#b3261e",
    "accent": "#1f5fae",
    "shade": "#b3261e",
    "shadow": "#17202a",
}
DARK = {
    "paper": "#11161b",
    "panel": "#1a2128",
    "sky": "#141b22",
    "ink": "#e6ebf0",
    "soft": "#9aa7b4",
    "line": "#313b45",
    "grid": "#26303a",
    "good": "#4cc49a",
    "bad": "#ff8a7a",
    "accent": "#7db4f5",
    "shade": "#ee6a58",
    "shadow": "#000000",
}
"""Themes of pages: grounds (paper, panel, sky), text, lines; ``shade`` is laid over the paper of tables."""
GROUNDS = ("paper", "panel", "sky")
TEXT_CONTRAST, MARK_CONTRAST = 4.5, 3.0


def hex_of(k: int, tasked: int | None = None) -> str:
    """Return the colour of vehicle ``k`` as #rrggbb; from the index ``tasked`` on vehicles are bystanders."""
    return VEHICLES[k % len(VEHICLES)] if tasked is None or k < tasked else BYSTANDER


def colours(count: int, tasked: int | None = None) -> NDArray[np.uint8]:
    """Return the colours (count, 3) of ``count`` vehicles, of which the first ``tasked`` fly the task."""
    return np.array([rgb(hex_of(k, tasked)) for k in range(count)], dtype=np.uint8).reshape(-1, 3)


def linear(colour: RGB | NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return sRGB (…, 3) as linear intensities.

    The browser program of viser expects linear intensities for the colours of batched meshes and of vertices;
    the one colour of a single mesh is sRGB.
    """
    return np.rint(255.0 * _intensity(colour)).astype(np.uint8)


def _intensity(colour: RGB | NDArray[np.uint8]) -> NDArray[np.float64]:
    share = np.asarray(colour) / 255.0
    found: NDArray[np.float64] = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    return found


def contrast(one: str, other: str) -> float:
    """Return the contrast ratio of two colours, 1 to 21 (WCAG 2.2)."""
    low, high = sorted(float(_intensity(rgb(code)) @ (0.2126, 0.7152, 0.0722)) for code in (one, other))
    return (high + 0.05) / (low + 0.05)


def readable(code: str, grounds: Iterable[str]) -> str:
    """Return ``code``, mixed with as little black or white as text on all ``grounds`` needs."""
    on = tuple(grounds)
    darker = contrast(on[0], "#000000") > contrast(on[0], "#ffffff")
    end = np.array((0, 0, 0) if darker else (255, 255, 255))
    for share in np.linspace(0.0, 1.0, 65):
        red, green, blue = np.rint((1.0 - share) * np.array(rgb(code)) + share * end).astype(int).tolist()
        found = f"#{red:02x}{green:02x}{blue:02x}"
        if all(contrast(found, ground) >= TEXT_CONTRAST for ground in on):
            break
    return found


@cache
def css(dark: bool) -> str:
    """Return the declarations of a theme's colours, for a page's style sheet."""
    theme = DARK if dark else LIGHT
    grounds = [theme[name] for name in GROUNDS]
    named = theme | {"solid": OBSTACLE, "bystander": BYSTANDER, "target": TARGET}
    named |= {f"vehicle-{k}": code for k, code in enumerate(VEHICLES)}
    named |= {f"label-{k}": readable(code, grounds) for k, code in enumerate(VEHICLES)}
    named |= {"label-target": readable(TARGET, grounds)}
    named["shade"] = ", ".join(map(str, rgb(theme["shade"])))
    return " ".join(f"--{name}: {value};" for name, value in named.items())


BODY, SOFT, GRID, BAD, ACCENT, SOLID = map(
    rgb, ("#6b7680", BYSTANDER, "#7a8086", "#d9483b", "#3f7fd0", OBSTACLE)
)
"""Colours of the view, whose ground is white or nearly black. The ground's lines are as plain on both."""


def coloured(draw: Callable[_P, _R]) -> Callable[_P, _R]:
    """Decorate a function that draws with matplotlib: its colours C0, C1 … are those of the vehicles."""

    @wraps(draw)
    def drawn(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        import matplotlib
        from cycler import cycler

        with matplotlib.rc_context({"axes.prop_cycle": cycler(color=VEHICLES)}):
            return draw(*args, **kwargs)

    return drawn
