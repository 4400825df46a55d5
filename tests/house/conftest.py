"""The command line, for the tests of documents."""

from __future__ import annotations

from tests.outrider.conftest import run

__all__ = ["run"]
