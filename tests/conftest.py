"""Hypothesis for all tests: no deadline, because a machine under load must not fail a law; and in CI the same
examples every time, so that what lands does not depend on luck. Elsewhere it goes on searching.

``--soak`` is what is too long for CI, and nothing else: tests marked ``soak``; each law, searched in many
rounds; fuzz tests with 10 000 mutants instead of some hundred.
"""

from __future__ import annotations

import os

import pytest
from hypothesis import is_hypothesis_test, settings

pytest_plugins = ["pytester"]

ROUNDS = 20
"""So often ``--soak`` runs each law, every time with other examples."""

settings.register_profile("laws", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "laws")


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("outrider")
    group.addoption("--soak", action="store_true", help="what is too long for CI, and nothing else")
    group.addoption(
        "--mutants",
        metavar="SEED[:INDEX]",
        default="1",
        help="fuzz with this seed, or only this mutant of it",
    )


def pytest_configure(config: pytest.Config) -> None:
    if config.getoption("soak"):
        settings.load_profile("laws")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    wanted = _gains if config.getoption("soak") else _fits
    left_out = [item for item in items if not wanted(item)]
    if left_out:
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if wanted(item)]


def _fits(item: pytest.Item) -> bool:
    """Whether CI has the time for it."""
    return item.get_closest_marker("soak") is None


def _gains(item: pytest.Item) -> bool:
    """Whether there is more to it than CI sees."""
    called = getattr(item, "callspec", None)
    return not _fits(item) or (called is not None and not {"mutants", "law_round"}.isdisjoint(called.params))


@pytest.fixture
def law_round(request: pytest.FixtureRequest) -> int:
    """Which round of a law this is."""
    return int(request.param)


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if metafunc.config.getoption("soak") and is_hypothesis_test(metafunc.function):
        # The law does not ask for it, but is run once for each.
        metafunc.fixturenames.append("law_round")
        metafunc.parametrize("law_round", range(ROUNDS), indirect=True)
