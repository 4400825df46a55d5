"""Corners of a way: a chain of cells shortened by straight lines that keep the clearance."""

from __future__ import annotations

from collections.abc import Generator
from itertools import pairwise

import numpy as np

from companion.values.horizon import Array
from companion.ways.clearance import Clearance

_SPACING_M = 0.25
"""Distance of the places on a way between which it is shortened and followed."""
_SPARE = 0.125
"""Clearance to spare in shortening, as a multiple of the square of a cell's edge over the clearance."""

Checks = Generator[None, None, Array]
"""Work that yields after each line that it checks, and returns corners (k, 3), m."""


def shortened(clear: Clearance, chain: Array, clearance: float) -> Checks:
    """Return corners (k, 3), m, of a way along the ``chain`` (n, 3), m, from its first to its last place.

    All lines between the corners keep the ``clearance`` (m), except where two places that follow each other
    in the chain do not. The chain is pulled taut forwards, then backwards and forwards again over places on
    the way, because a taut way bends only at places of its chain.
    """
    way = yield from _taut(clear, chain, clearance)
    for _ in range(2):
        way = yield from _taut(clear, along(way)[::-1], clearance)
    return way


def along(corners: Array, spacing: float = _SPACING_M) -> Array:
    """Return places (n, 3), m, on the way over ``corners`` (k, 3), m, among them each corner.

    They are ``spacing`` (m) from each other at most.
    """
    parts = [corners[:1]]
    for one, two in pairwise(corners):
        line = two - one
        count = int(np.sqrt(line @ line) / spacing) + 1
        places = one + np.arange(1.0, count + 1.0)[:, None] / count * line
        places[-1] = two
        parts.append(places)
    return np.concatenate(parts)


def lengths(places: Array) -> Array:
    """Return the length (n,), m, of the way over ``places`` (n, 3), m, up to each."""
    pieces = np.diff(places, axis=0)
    found: Array = np.concatenate([[0.0], np.cumsum(np.sqrt((pieces * pieces).sum(axis=1)))])
    return found


def _taut(clear: Clearance, chain: Array, clearance: float) -> Checks:
    """Return those places of the ``chain`` at which a taut way over it bends, and both ends.

    From each bend the way goes straight to a place from which the next ones are not seen. It is found in
    steps that grow twofold while the place is seen, and shrink to one then; so far clearances between cells
    are interpolated, with about the error of that (``lines.py``) to spare. The last line is checked exactly.
    """
    wanted = clearance + _SPARE * clear.grid.cell**2 / max(clearance, clear.grid.cell)
    kept, last = [0], len(chain) - 1
    while kept[-1] < last:
        # The next place of the chain always follows.
        seen, step, grows = kept[-1] + 1, 1, True
        while step and seen < last:
            place = min(seen + step, last)
            if clear.sees(chain[kept[-1]], chain[place], wanted):
                seen = place
                step = 2 * step if grows else step // 2
            else:
                step, grows = step // 2, False
        yield
        while seen > kept[-1] + 1 and not clear.free(chain[kept[-1]], chain[seen], clearance):
            seen = (kept[-1] + seen) // 2
            yield
        kept.append(seen)
    found: Array = chain[kept]
    return found
