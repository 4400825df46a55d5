"""Fixtures ``fly`` and ``replay``. Heavy modules are imported when a test uses them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from outrider.testing.flown import Flown, Replayed
    from outrider.testing.golden import Golden


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option ``--update-golden``."""
    group = parser.getgroup("outrider")
    group.addoption(
        "--update-golden", action="store_true", help="write golden files of set-points instead of comparing"
    )


@pytest.fixture
def golden(request: pytest.FixtureRequest) -> Iterator[Golden]:
    """Provide the golden files in the folder ``golden`` beside the test."""
    from outrider.testing.golden import Golden

    update = bool(request.config.getoption("update_golden"))
    files = Golden(request.path.parent / "golden", update=update)
    yield files
    for path in files.written:
        # Appears in the captured output, which -rP shows.
        print(f"golden file written: {path}")  # noqa: T201


@pytest.fixture
def fly(tmp_path: Path, golden: Golden) -> Callable[..., Flown]:
    """Fly a scenario in lock-step: ``fly("antipodal-8", seed=3, vehicles=4, companion={…})``.

    The scenario is a name or a file; further arguments change its keys. Raises InputError for invalid
    changes.
    """

    def call(scenario: str | Path, seed: int = 1, **changes: Any) -> Flown:
        from outrider.testing.scenes import flown

        return flown(scenario, seed, changes, tmp_path, golden)

    return call


@pytest.fixture
def replay(golden: Golden) -> Callable[..., Replayed]:
    """Replay a log to a companion: ``replay("flight.tlog", own=1, target=2)``.

    The result is what a companion would have sent. Settings are those of the scenario ``like``; further
    arguments change its companions' keys. Raises InputError for invalid arguments.
    """

    def call(
        log: str | Path,
        own: int,
        neighbours: tuple[int, ...] | None = None,
        target: int | None = None,
        like: str = "escort",
        **changes: Any,
    ) -> Replayed:
        from outrider.testing.scenes import replayed

        return replayed(Path(log), own, neighbours, target, like, changes, golden)

    return call
