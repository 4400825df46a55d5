"""Animated picture of a flight, for the README: ``python -m reference.animation RUN_DIR PICTURE``.

A look from above at an angle at the ground with its grid, the ring around the target, the vehicles with
trails and shadows. The camera follows the target over the ground.
"""

from __future__ import annotations

import sys
from math import cos, radians, sin
from pathlib import Path
from typing import Final

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from outrider import Flight, palette

Array = NDArray[np.float64]

_PIXELS: Final = (720, 405)
_DPI: Final = 90
_FRAME_S, _FRAMES = 0.1, 170
_SPEED: Final = 2.5
"""Seconds of flight in a second of the picture."""
_REACH_M: Final = (11.5, 6.5)
"""Half of what is seen, across and up the picture, m at the target."""
_TRAIL_S: Final = 3.0
_LEAN: Final = radians(38.0)
"""Angle of the look below the horizon."""
_RING, _GROUND, _LINES, _WORDS = (palette.LIGHT[name] for name in ("soft", "sky", "line", "soft"))
_COLOURS_IN_PICTURE: Final = 64


def main() -> None:
    """Draw the flight of a run directory."""
    flight, place = Flight(sys.argv[1]), Path(sys.argv[2])
    start = float(sys.argv[3]) if len(sys.argv) > 3 else 0.0
    frames = [_frame(flight, start + k * _FRAME_S * _SPEED) for k in range(_FRAMES)]
    some = np.vstack([np.asarray(frame) for frame in frames[:: len(frames) // 5]])
    chosen = Image.fromarray(some).quantize(_COLOURS_IN_PICTURE, Image.Quantize.MAXCOVERAGE)
    quantised = [frame.quantize(palette=chosen, dither=Image.Dither.NONE) for frame in frames]
    quantised[0].save(
        place,
        save_all=True,
        append_images=quantised[1:],
        duration=round(1000 * _FRAME_S),
        loop=0,
        optimize=True,
    )
    sys.stdout.write(f"{place}: {place.stat().st_size / 1e6:.2f} MB\n")


def _project(points: Array, centre: Array) -> Array:
    """Return where points (n, 3), m, are in the picture (n, 2), seen from the south and from above."""
    off = points - centre
    return np.column_stack([off[:, 0], sin(_LEAN) * off[:, 1] + cos(_LEAN) * off[:, 2]])


def _frame(flight: Flight, time: float) -> Image.Image:
    """Return the picture at ``time`` (s) after the start."""
    now = int(np.searchsorted(flight.times, time))
    now = min(now, len(flight.times) - 1)
    target = flight.target.astype(np.float64)
    # The camera moves as the mean of the target's way, so that its jitter is not the picture's.
    around = slice(max(now - 50, 0), now + 51)
    height = 0.55 * float(flight.positions[around, :, 2].mean())
    centre = np.array([*target[around, :2].mean(axis=0), height])
    figure = Figure(figsize=(_PIXELS[0] / _DPI, _PIXELS[1] / _DPI), dpi=_DPI, facecolor=_GROUND)
    axes = figure.add_axes(
        (0.0, 0.0, 1.0, 1.0), xlim=(-_REACH_M[0], _REACH_M[0]), ylim=(-_REACH_M[1], _REACH_M[1])
    )
    axes.set_axis_off()
    axes.add_collection(LineCollection(_grid(centre), colors=_LINES, linewidths=1.0))
    surface = flight.scenario.companion.surface.outline()
    axes.plot(*_project(target[now] + surface, centre).T, color=_RING, lw=1.4, ls=(0, (4, 3)))
    back = max(now - round(_TRAIL_S * 50), 0)
    trails = flight.positions[back : now + 1 : 4].astype(np.float64)
    _draw(axes, target[back : now + 1 : 4], centre, palette.TARGET, 9.0)
    right, up = _project(target[now : now + 1], centre)[0]
    on = (palette.LIGHT["sky"],)
    axes.text(right + 0.7, up, "target", color=palette.readable(palette.TARGET, on), va="center")
    for k in range(trails.shape[1]):
        _draw(axes, trails[:, k], centre, palette.hex_of(k), 7.0)
    separation = float(np.min(flight.separation[max(now - 50, 0) : now + 1]))
    words = f"{flight.scenario.name}   {time:4.1f} s   least distance of two vehicles {separation:4.1f} m"
    axes.text(
        0.02,
        0.03,
        words,
        transform=axes.transAxes,
        color=_WORDS,
        fontsize=10,
        va="bottom",
        family="monospace",
    )
    canvas = FigureCanvasAgg(figure)
    canvas.draw()  # type: ignore[no-untyped-call]
    pixels = np.asarray(canvas.buffer_rgba())  # type: ignore[no-untyped-call]
    return Image.fromarray(pixels[..., :3].copy())


def _grid(centre: Array) -> list[Array]:
    """Return the lines of the ground every 2 m, near the centre."""
    low, high = np.floor((centre[:2] - 22.0) / 2.0) * 2.0, np.ceil((centre[:2] + 22.0) / 2.0) * 2.0
    lines = [np.array([[x, low[1], 0.0], [x, high[1], 0.0]]) for x in np.arange(low[0], high[0] + 1.0, 2.0)]
    lines += [np.array([[low[0], y, 0.0], [high[0], y, 0.0]]) for y in np.arange(low[1], high[1] + 1.0, 2.0)]
    return [_project(line, centre) for line in lines]


def _draw(axes: object, way: Array, centre: Array, colour: str, size: float) -> None:
    """Draw a vehicle at the end of its ``way`` (n, 3), with its trail and its shadow."""
    plot = axes.plot  # type: ignore[attr-defined]
    here = _project(way, centre)
    shadow = _project(way[-1:] * (1.0, 1.0, 0.0), centre)
    plot(*shadow.T, "o", color="#000000", alpha=0.16, ms=size, mew=0)
    plot(*np.vstack([shadow, here[-1:]]).T, color="#000000", alpha=0.10, lw=0.8)
    plot(*here.T, color=colour, alpha=0.45, lw=1.6)
    arm = 0.42 * size / 7.0
    for angle in np.radians([30.0, 90.0, 150.0]):
        ends = np.array([[cos(angle), sin(angle), 0.0], [-cos(angle), -sin(angle), 0.0]]) * arm
        place = _project(way[-1] + ends, centre)
        plot(*place.T, color=colour, lw=1.8)
        plot(*place.T, "o", color=colour, ms=0.55 * size, mfc="white", mew=1.3)


if __name__ == "__main__":
    main()
