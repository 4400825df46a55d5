"""Workers: results come from the tasks alone, and a worker that dies costs the one run it was at."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from outrider.errors import OutriderError
from outrider.sweep import pool, process
from outrider.sweep.pool import MOST_STARTS, Pool
from outrider.sweep.tasks import Entry, Task
from tests.outrider.sweep import runs as sweep_runs
from tests.outrider.sweep.runs import RUNS

LONG = 600.0


def tasks(count: int) -> list[Task]:
    return [Task("cell", seed, "x") for seed in range(count)]


def work(run: str, count: int, jobs: int = 2, limit: float = LONG) -> list[Entry]:
    entries: list[Entry] = []
    with Pool(f"{RUNS}:{run}", jobs, limit) as pool:
        pool.work(tasks(count), entries.append)
        pids = pool.workers
    assert not any(alive(pid) for pid in pids)
    return entries


def alive(pid: int) -> bool:
    """Whether it runs; one that waits to be buried does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except (FileNotFoundError, ProcessLookupError):
        return False


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(sweep_runs.FOLDER, str(tmp_path))


def result(entries: list[Entry]) -> list[tuple[int, str, object]]:
    return sorted((e.seed, e.status, e.summary) for e in entries)


def test_results_depend_on_the_tasks_alone() -> None:
    expected = [(task.seed, "done", sweep_runs.swap(task)) for task in tasks(30)]
    for jobs in (1, 3):
        assert result(work("swap", 30, jobs)) == expected


def test_nothing_to_do_starts_nobody() -> None:
    assert work("swap", 0) == []


def test_no_more_workers_than_tasks() -> None:
    with Pool(f"{RUNS}:threads", 8, LONG) as pool:
        entries: list[Entry] = []
        pool.work(tasks(2), entries.append)
        assert len(pool.workers) == 2


def test_each_worker_has_one_thread_and_runs_many() -> None:
    entries = work("threads", 12)
    summaries = [entry.summary or {} for entry in entries]
    assert all(summary["threads"] == ["1", "1", "1"] for summary in summaries)
    assert len({summary["pid"] for summary in summaries}) <= 2


def test_a_run_that_raises_is_a_fault_with_its_message_and_costs_no_worker() -> None:
    entries = {entry.seed: entry for entry in work("breaks", 9, jobs=1)}
    for seed, entry in entries.items():
        assert entry.status == ("fault" if seed % 3 == 0 else "done")
    what = entries[3].what
    assert what is not None
    assert what.startswith("RuntimeError: seed 3 is bad (runs.py:")


def test_a_result_that_is_no_json_is_a_fault() -> None:
    (entry,) = work("no_json", 1)
    assert entry.status == "fault"
    assert "ValueError" in (entry.what or "")


def test_a_killed_worker_costs_one_run_which_is_tried_again_at_the_end(tmp_path: Path) -> None:
    entries = work("kills_once", 12)
    lost = [entry for entry in entries if entry.status == "lost"]
    assert [(entry.seed, entry.what) for entry in lost] == [(3, "its worker was killed by SIGKILL")]
    assert sorted(entry.seed for entry in entries if entry.status == "done") == list(range(12))
    assert entries[-1].seed == 3
    assert len((tmp_path / "cell-3").read_text().splitlines()) == 2


def test_what_kills_its_worker_again_stays_lost(tmp_path: Path) -> None:
    entries = work("kills_always", 6)
    assert sorted(entry.seed for entry in entries if entry.status == "done") == [0, 1, 2, 4, 5]
    assert [entry.seed for entry in entries if entry.status == "lost"] == [3, 3]
    assert len((tmp_path / "cell-3").read_text().splitlines()) == 2


def test_a_worker_that_ends_by_itself_is_lost_too() -> None:
    lost = [entry for entry in work("leaves", 5) if entry.status == "lost"]
    assert {entry.what for entry in lost} == {"its worker ended with status 7"}


@pytest.mark.parametrize(("jobs", "others"), [(1, {0, 1, 2}), (2, {0, 1, 2, 4})])
def test_a_run_that_hangs_is_ended_by_the_wall_limit(
    jobs: int, others: set[int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The limit is over when seed 3 has begun and nobody else is at anything; with one worker seed 4 still
    waits then."""
    over, entries = 0, list[Entry]()
    clock = SimpleNamespace(monotonic=lambda: time.monotonic() + over * LONG)
    monkeypatch.setattr(process, "time", clock)
    monkeypatch.setattr(pool, "time", clock)

    def pass_time() -> None:
        nonlocal over
        begun = tmp_path / "cell-3"
        starts = begun.read_text().count("\n") if begun.exists() else 0
        if starts > over and others <= {entry.seed for entry in entries if entry.status == "done"}:
            over += 1

    with Pool(f"{RUNS}:hangs", jobs, LONG) as workers:
        workers.work(tasks(5), entries.append, pass_time)
    lost = [(entry.seed, entry.what) for entry in entries if entry.status == "lost"]
    assert lost == [(3, "took longer than 600 s of wall time")] * 2
    assert sorted(entry.seed for entry in entries if entry.status == "done") == [0, 1, 2, 4]


def test_a_worker_killed_from_outside_is_replaced(tmp_path: Path) -> None:
    """Killed while it waits for nothing but us: seed 0 begins, and its worker is killed then."""
    killed: list[int] = []

    def kill_the_first() -> None:
        begun = tmp_path / "cell-0"
        if not killed and begun.exists() and begun.read_text():
            killed.append(int(begun.read_text().split()[0]))
            os.kill(killed[0], signal.SIGKILL)

    entries: list[Entry] = []
    with Pool(f"{RUNS}:waits", 1, LONG) as pool, pytest.raises(StopIteration):
        pool.work(tasks(1), lambda entry: stop_after(entries, entry), kill_the_first)
    assert [(entry.seed, entry.status) for entry in entries] == [(0, "lost")]


def stop_after(entries: list[Entry], entry: Entry) -> None:
    entries.append(entry)
    raise StopIteration


@pytest.mark.parametrize("run", [f"{RUNS}:nothing", "no_such_module:run", RUNS])
def test_a_run_that_is_not_there_is_said_at_once(run: str) -> None:
    with Pool(run, 2, LONG) as pool, pytest.raises(OutriderError, match="no worker can start"):
        pool.work(tasks(3), lambda _: None)


def test_workers_that_die_before_they_are_ready_are_not_started_for_ever(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "stillborn.py").write_text("import os\nos._exit(9)\n")
    monkeypatch.syspath_prepend(tmp_path)
    with (
        Pool("stillborn:run", 2, LONG) as pool,
        pytest.raises(OutriderError, match=f"{MOST_STARTS} in a row ended; its worker ended with status 9"),
    ):
        pool.work(tasks(3), lambda _: None)


def test_a_pool_that_is_left_early_leaves_no_process(tmp_path: Path) -> None:
    def stop() -> None:
        if (tmp_path / "cell-0").exists():
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), Pool(f"{RUNS}:waits", 2, LONG) as pool:
        pool.work(tasks(2), lambda _: None, stop)
    assert pool.workers
    assert not any(alive(pid) for pid in pool.workers)
