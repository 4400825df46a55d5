"""Sender of a message, and a vector of three numbers."""

from __future__ import annotations

from typing import NamedTuple

Vector = tuple[float, float, float]


class Source(NamedTuple):
    """Sender of a message: MAVLink system and component id (both 0…255)."""

    system: int
    component: int
