"""In certified flight the parent leaves the hold to the backup node, and asks itself only without one."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from outrider.onboard import flight
from outrider.onboard.backup import End
from outrider.onboard.flight import MOST
from outrider.onboard.worker import Worker
from outrider.scenarios.fly_config import FlyConfig
from tests.outrider.onboard.supervised import flown
from tests.outrider.onboard.test_certified_request import BASE, MEASURED

CONFIG = FlyConfig.model_validate(
    BASE | {"companion": {"task": "goto", "avoidance": "certified", "certified": MEASURED}}
)
STATE: dict[str, Any] = {"phase": "escort", "beat": (2, 3, 1 | 128, 4, 4)}


@pytest.mark.parametrize(
    "end",
    [End("holds (BRAKE)", False, 7), End("did not take BRAKE", True, 7), None],
    ids=["held", "not", "lost"],
)
def test_each_loss_is_followed_by_the_backup_nodes_hold_and_then_the_next_companion(
    end: End | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    done: list[str] = []
    near, far = os.pipe()

    class Lost:
        """A flying process that is killed at once."""

        sentinel, status, killed = near, -9, False

        def __init__(self, worker: Worker) -> None:
            self._worker = worker

        def start(self) -> int:
            done.append("companion")
            self._worker._orders.tell(kind="state", **STATE)
            return 0

        def join(self) -> None:
            """It is gone."""

    class Backup:
        """A backup node that ends as the test says."""

        carried = 7

        def __init__(self, *_given: object) -> None:
            self.copies = None

        def start(self) -> None:
            done.append("backup")

        def release(self) -> None:
            """Nothing is open."""

        def look(self) -> None:
            """Nothing is lost."""

        def relieve(self, _look: Callable[[], None]) -> End | None:
            done.append("relieved")
            return end

        def close(self) -> None:
            """Nothing is open."""

    def asked(*_given: object) -> None:
        done.append("asked")

    monkeypatch.setattr(flight, "Backup", Backup)
    monkeypatch.setattr(flight, "farewell", asked)
    over = flown(CONFIG, "own", Lost, tmp_path, monkeypatch)
    os.close(near)
    os.close(far)
    one = ["backup", "companion", "relieved", *(["asked"] if end is None else [])]
    assert done == one * MOST
    assert over.carried == 7 * MOST
    if end is not None:
        assert over.last_word == end.said
