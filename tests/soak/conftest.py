"""Fuzz tests ask for ``mutants``: some hundred in CI, 10 000 with ``--soak``, in pieces that run side by side
and show how far it is. One that fails says how to run it alone."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.soak.campaigns import Mutants, bounded_memory

IN_CI, IN_SOAK, PIECE = 300, 10_000, 500


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "mutants" not in metafunc.fixturenames:
        return
    count = IN_SOAK if metafunc.config.getoption("soak") else IN_CI
    seed, _, index = str(metafunc.config.getoption("mutants")).partition(":")
    pieces = (
        [range(int(index), int(index) + 1)]
        if index
        else [range(first, min(first + PIECE, count)) for first in range(0, count, PIECE)]
    )
    metafunc.parametrize(
        "mutants",
        [(int(seed), piece) for piece in pieces],
        indirect=True,
        ids=[f"{seed}:{piece.start}-{piece.stop - 1}" for piece in pieces],
    )


@pytest.fixture
def mutants(request: pytest.FixtureRequest) -> Iterator[Mutants]:
    """The piece of the campaign that this test is to run, in bounded memory."""
    seed, piece = request.param
    name = request.node.nodeid.partition("[")[0]
    with bounded_memory():
        yield Mutants(name, seed, piece)
