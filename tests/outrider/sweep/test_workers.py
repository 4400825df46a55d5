"""Workers of a command: processes of this machine or a Dask scheduler, with the limit that was asked for."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from outrider.errors import InputError
from outrider.processes import processor as names
from outrider.sweep import cluster, workers
from outrider.sweep.workers import Machines


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Any, ...]]:
    """What pools and clusters were made with."""
    found: list[tuple[Any, ...]] = []
    monkeypatch.setattr(workers, "Pool", lambda *given: found.append(("pool", *given)))
    monkeypatch.setattr(cluster, "Cluster", lambda *given: found.append(("cluster", *given)))
    return found


def test_the_limit_and_the_place_reach_the_workers(made: list[tuple[Any, ...]]) -> None:
    Machines(3, wall_limit_s=60.0).workers("m:f")
    Machines(scheduler="tcp://host:1", wall_limit_s=70.0).workers("m:f")
    assert made == [("pool", "m:f", 3, 60.0), ("cluster", "tcp://host:1", "m:f", 70.0)]


def test_processes_and_a_scheduler_contradict_each_other() -> None:
    with pytest.raises(InputError, match="--jobs does not go with --scheduler"):
        Machines(1, "tcp://host:1")


@pytest.mark.parametrize("text", ["processor: 0\n", None])
def test_a_processor_without_a_name_has_that_of_its_architecture(
    text: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "cpuinfo"
    if text is not None:
        path.write_text(text)
    monkeypatch.setattr(names, "_CPU_INFO", path)
    assert names.processor()
    path.write_text("model name\t: Some  CPU @ 2 GHz\n")
    assert names.processor() == "Some CPU @ 2 GHz"
