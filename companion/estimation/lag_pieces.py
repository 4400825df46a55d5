"""Pieces of the time of one sender's messages: the least lag of each shows the rate of the sender's clock."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice, pairwise
from typing import NamedTuple

MAX_PIECES = 13
"""Number of pieces; from the first to the last they cover more than a minute."""
_MIN_PIECES_FOR_RATE = 7
"""Number of pieces (half a minute) over which lags must have changed steadily for a rate to be learnt.

Steadily: the spread of the lags about a straight line is at most the share ``_MAX_NONLINEARITY`` of their
whole change; a delay that rises in a few steps exceeds it. A rate below ``_MIN_LEARNT_RATE`` is not learnt.
"""
_MAX_NONLINEARITY, _MIN_LEARNT_RATE = 0.125, 0.002


class Piece(NamedTuple):
    """The least ``lag`` of a piece that started at ``begun``.

    ``received``: when its message arrived; ``above``: its distance above the line. All µs.
    """

    begun: int
    received: int
    lag: int
    above: float


def recent(pieces: Sequence[Piece]) -> Sequence[Piece]:
    """Return the last pieces, those from which a rate may be learnt."""
    return list(islice(pieces, max(len(pieces) - _MIN_PIECES_FOR_RATE, 0), None))


def line_below(pieces: Sequence[Piece], rate: float, received: int) -> float:
    """Return the value at ``received`` of the line of this ``rate`` that touches ``pieces`` from below."""
    return min(piece.lag + rate * (received - piece.received) for piece in pieces)


def steady_rate(pieces: Sequence[Piece]) -> float:
    """Return the rate at which the lags have changed steadily; 0 if they have not, or it is not known yet."""
    if len(pieces) < _MIN_PIECES_FOR_RATE:
        return 0.0
    rate = _slope_below(pieces)
    if abs(rate) < _MIN_LEARNT_RATE:
        return 0.0
    off = [piece.lag - rate * (piece.received - pieces[0].received) for piece in pieces]
    change = abs(rate) * (pieces[-1].received - pieces[0].received)
    return rate if max(off) - min(off) <= _MAX_NONLINEARITY * change else 0.0


def _slope_below(pieces: Sequence[Piece]) -> float:
    """Return the slope of the highest line below all ``pieces``.

    It is the slope of the edge of their lower hull at the middle of their time.
    """
    hull: list[Piece] = []
    for point in pieces:
        while len(hull) > 1 and _slope(hull[-2], hull[-1]) >= _slope(hull[-1], point):
            hull.pop()
        hull.append(point)
    middle = (pieces[0].received + pieces[-1].received) / 2
    return next(_slope(a, b) for a, b in pairwise(hull) if b.received >= middle)


def _slope(a: Piece, b: Piece) -> float:
    return (b.lag - a.lag) / (b.received - a.received)
