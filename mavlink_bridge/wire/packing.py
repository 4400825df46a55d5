"""Packing of frames into datagrams that pass any network in one piece."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

LONGEST: Final = 1400
"""Largest number of bytes of a datagram: what one Ethernet packet carries, also through tunnels.

Some clients read no more than 2048 bytes, and UDP carries at most 65507.
"""


def parcels(pieces: Sequence[bytes], longest: int = LONGEST) -> list[bytes]:
    """Pack ``pieces`` (complete frames) in their order, several to a datagram where they fit.

    A piece that is longer than ``longest`` gets a datagram of its own.
    """
    whole = b"".join(pieces)
    if len(whole) <= longest:
        return [whole] if whole else []
    found: list[bytes] = []
    waiting = b""
    for piece in pieces:
        if waiting and len(waiting) + len(piece) > longest:
            found.append(waiting)
            waiting = b""
        waiting += piece
    return [*found, waiting]
