"""What the companion raises. Nothing that arrives by a link raises: it is counted and dropped."""

from __future__ import annotations


class CompanionError(Exception):
    """Base of every error of ``companion``."""


class ShapeError(CompanionError):
    """A vector of the wrong size was about to reach the solver, which would not have noticed."""


class SolverError(CompanionError):
    """No acceptable solution; carries the solver's status, never a half-made plan."""

    def __init__(self, status: str, iterations: int) -> None:
        super().__init__(f"the QP was not solved: {status} after {iterations} iterations")
        self.status = status
        self.iterations = iterations


class SurfaceError(CompanionError):
    """A user's surface cannot be used. Example: its function raises, or gives a NaN."""


class CertificateError(CompanionError):
    """A plan that may not be committed: it does not end at rest, or breaks its planes."""
