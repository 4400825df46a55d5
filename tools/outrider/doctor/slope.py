"""Slope of one quantity over another."""

from __future__ import annotations

from typing import Final

_MIN_SQUARE_SUM: Final = 0.5


class Slope:
    """Least-squares slope, without intercept, of one quantity's changes over the other's (same unit)."""

    def __init__(self) -> None:
        self._both = self._square = 0.0

    def tell(self, change: float, answer: float) -> None:
        """Add a pair: when one quantity changed by ``change`` the other changed by ``answer``."""
        self._both += change * answer
        self._square += change * change

    @property
    def value(self) -> float | None:
        """Slope; None if too little has changed to tell."""
        return self._both / self._square if self._square > _MIN_SQUARE_SUM else None
