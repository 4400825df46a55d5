"""Errors that the companion raises.

Input from a link never raises: it is counted and dropped.
"""

from __future__ import annotations


class CompanionError(Exception):
    """Base of every error of ``companion``."""


class ShapeError(CompanionError):
    """Vector of the wrong size, or with NaN, for the QP; PIQP would not detect it."""


class SolverError(CompanionError):
    """No acceptable solution; carries the solver's status, never a partial plan."""

    def __init__(self, status: str, iterations: int) -> None:
        super().__init__(f"the QP was not solved: {status} after {iterations} iterations")
        self.status = status
        self.iterations = iterations


class SurfaceError(CompanionError):
    """Unusable user-defined surface: for example, its function raises or returns a NaN."""


class CertificateError(CompanionError):
    """Plan that may not be committed: it does not end at rest, or it is not finite."""
