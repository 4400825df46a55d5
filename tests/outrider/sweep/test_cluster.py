"""Sweeps on a real Dask scheduler and workers: the rules and the table are those of the local pool, whoever
dies."""

from __future__ import annotations

import json
import os
import shutil
import signal
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import dask
import pyarrow.parquet
import pytest

from outrider.errors import InputError
from outrider.sweep import scheduler
from outrider.sweep.cluster import Cluster
from outrider.sweep.command import sweep
from outrider.sweep.tasks import AbandonedError, Entry, Task
from tests.outrider.sweep import runs as sweep_runs
from tests.outrider.sweep.dask_machines import Machines
from tests.outrider.sweep.runs import RUNS

pytestmark = pytest.mark.slow
ROOT = Path(__file__).parents[3]
LONG = 600.0
SWEEP = """
name: methods
scenarios: [antipodal-8]
runs: 100
grid:
  companion.methods: [[baseline], [tangential]]
"""


@pytest.fixture(scope="module")
def machines(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Machines]:
    """One worker that flies two at a time."""
    with Machines(tmp_path_factory.mktemp("machines")) as those:
        those.worker(threads=2)
        yield those


@pytest.fixture
def mortal(tmp_path: Path) -> Iterator[Machines]:
    """Machines that a test may kill; no worker yet."""
    with Machines(tmp_path) as those:
        yield those


def tasks(key: str, count: int) -> list[Task]:
    return [Task(key, seed, "x") for seed in range(count)]


def work(those: Machines, run: str, count: int, limit: float = LONG) -> list[Entry]:
    entries: list[Entry] = []
    with Cluster(those.address, f"{RUNS}:{run}", limit) as cluster:
        cluster.work(tasks(run, count), entries.append)
    return entries


def test_results_depend_on_the_tasks_alone(machines: Machines) -> None:
    entries = work(machines, "swap", 30)
    assert sorted((e.seed, e.status, e.summary) for e in entries) == [
        (task.seed, "done", sweep_runs.swap(task)) for task in tasks("swap", 30)
    ]


def test_a_run_that_raises_is_a_fault_with_its_message(machines: Machines) -> None:
    entries = {entry.seed: entry for entry in work(machines, "breaks", 6)}
    assert {seed for seed, entry in entries.items() if entry.status == "fault"} == {0, 3}
    assert (entries[3].what or "").startswith("RuntimeError: seed 3 is bad (runs.py:")


def test_a_run_that_takes_its_process_down_is_named_and_tried_once_more(machines: Machines) -> None:
    for run, lost in (("kills_once", 1), ("kills_always", 2)):
        entries = work(machines, run, 8)
        assert [(e.seed, e.what) for e in entries if e.status == "lost"] == [
            (3, "its worker was killed by SIGKILL")
        ] * lost
        assert len([e for e in entries if e.status == "done"]) == 9 - lost
        assert entries[-1].seed == 3


def test_a_run_that_hangs_is_ended_by_the_wall_limit(machines: Machines) -> None:
    entries = work(machines, "hangs", 5, limit=1.0)
    assert {e.seed for e in entries if e.status == "done"} == {0, 1, 2, 4}
    assert {e.what for e in entries if e.status == "lost"} == {"took longer than 1 s of wall time"}


def test_a_run_that_is_not_there_is_said_at_once(machines: Machines) -> None:
    with (
        Cluster(machines.address, "no_such_module:run", LONG) as cluster,
        pytest.raises(InputError, match=r"no worker can fly.*no_such_module"),
    ):
        cluster.work(tasks("none", 3), lambda _: None)


# The whole command


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv(sweep_runs.FOLDER, str(tmp_path))
    (tmp_path / "methods.yaml").write_text(SWEEP, encoding="utf-8")
    return tmp_path


def fly(run: str, those: Machines | None = None, **options: Any) -> int:
    address = None if those is None else those.address
    return sweep("methods.yaml", out=Path("out"), run=f"{RUNS}:{run}", scheduler=address, **options)


def expected(capsys: pytest.CaptureFixture[str]) -> tuple[bytes, str]:
    """What a sweep in this process leaves and shows."""
    assert fly("swap", jobs=2) == 1
    summary, table = Path("out/summary.json").read_bytes(), capsys.readouterr().out
    Path("out").rename("local")
    return summary, table


def same_rows(name: str) -> bool:
    """Whether the Parquet of the sweep here and of that with Dask hold the same."""
    return bool(pyarrow.parquet.read_table(f"out/{name}").equals(pyarrow.parquet.read_table(f"local/{name}")))


def test_a_killed_worker_costs_the_one_run_that_is_named_and_the_table_is_the_local_one(
    here: Path, mortal: Machines, capsys: pytest.CaptureFixture[str]
) -> None:
    summary, table = expected(capsys)
    mortal.worker()
    mortal.worker()
    assert fly("kills_machine", mortal) == 1
    said = capsys.readouterr()
    assert (Path("out/summary.json").read_bytes(), said.out) == (summary, table)
    assert same_rows("summary.parquet")
    assert same_rows("runs.parquet")
    (lost,) = [line for line in said.err.splitlines() if line.startswith("lost: ")]
    assert "seed 5: its Dask worker tcp://127.0.0.1:" in lost
    assert lost.endswith(" is gone")
    lines = [json.loads(line)["run"] for line in Path("out/journal.jsonl").read_text().splitlines()[1:]]
    assert len(lines) == 201
    assert [line["seed"] for line in lines if line["status"] == "lost"] == [5]


@pytest.mark.usefixtures("ctrl_c")
@pytest.mark.parametrize("who", ["sweep", "scheduler"])
def test_what_was_flown_is_kept_and_gone_on_with_here(
    who: str, here: Path, mortal: Machines, capsys: pytest.CaptureFixture[str]
) -> None:
    """Ctrl-C at the sweep, or the scheduler dies; and a sweep in this process does the rest."""
    summary, table = expected(capsys)
    other = (os.getpid(), int(signal.SIGINT)) if who == "sweep" else (mortal.scheduler.pid, 9)
    (here / "other").write_text("{} {}".format(*other))
    mortal.worker(threads=2)
    assert fly("kills_other", mortal) == 3
    said = capsys.readouterr()
    assert said.out == ""
    why = "stopped after" if who == "sweep" else f"the scheduler {mortal.address} has gone; stopped after"
    assert f"{why} " in said.err
    assert "ERROR" not in said.err
    assert f"outrider sweep methods.yaml --out out --scheduler {mortal.address}" in said.err
    kept = len(Path("out/journal.jsonl").read_text().splitlines()) - 1
    assert 0 < kept < 200
    assert fly("swap", jobs=2) == 1
    assert (Path("out/summary.json").read_bytes(), capsys.readouterr().out) == (summary, table)


def test_jobs_and_scheduler_exclude_each_other_and_leave_nothing(here: Path, machines: Machines) -> None:
    with pytest.raises(InputError, match="--jobs does not go with --scheduler"):
        fly("swap", machines, jobs=2)
    assert not Path("out").exists()


# Who is refused


def test_a_worker_with_other_code_gets_nothing_and_is_named(
    here: Path, mortal: Machines, capsys: pytest.CaptureFixture[str]
) -> None:
    other = here / "other"
    shutil.copytree(ROOT / "companion", other / "companion", ignore=shutil.ignore_patterns("__pycache__"))
    (other / "companion" / "new.py").write_text("", encoding="utf-8")
    mortal.worker(path=str(other))
    with pytest.raises(InputError, match=r"no worker can fly: tcp://\S+: code \w+ \(here \w+\); allowed"):
        fly("fine", mortal, runs=2)
    mortal.worker()
    entries = work(mortal, "swap", 6)
    assert len(entries) == 6
    said = capsys.readouterr().err
    assert "refused: tcp://127.0.0.1:" in said


def test_a_worker_without_outrider_is_refused(here: Path, mortal: Machines) -> None:
    (here / "bare" / "outrider").mkdir(parents=True)
    (here / "bare" / "outrider" / "__init__.py").touch()
    mortal.worker(path=str(here / "bare"))
    with pytest.raises(InputError, match="cannot fly: ModuleNotFoundError: No module named 'outrider"):
        work(mortal, "fine", 2)


def test_without_a_worker_it_waits_and_says_so(mortal: Machines, capsys: pytest.CaptureFixture[str]) -> None:
    with (
        Cluster(mortal.address, f"{RUNS}:fine", LONG, patience_s=1.0) as cluster,
        pytest.raises(AbandonedError, match="has had no worker for 1 s"),
    ):
        cluster.work(tasks("wait", 2), lambda _: None)
    assert f"waiting for one: dask worker {mortal.address}" in capsys.readouterr().err


@pytest.mark.parametrize(
    "address", ["", "host", "tcp://host", "http://127.0.0.1:80", "tcp://a:99999", "a b:1"]
)
def test_what_is_no_address_is_said(address: str) -> None:
    with pytest.raises(InputError, match=r"is no address; allowed: tcp://HOST:PORT"):
        scheduler.connected(address)


@pytest.mark.parametrize("listens", [False, True])
def test_where_nobody_or_somebody_else_answers_is_said(
    listens: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(scheduler, "CONNECT_S", 0.5)
    why = "whoever answers there is no Dask scheduler" if listens else "nobody answers there"
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        if listens:
            taken.listen()
        address = f"tcp://127.0.0.1:{taken.getsockname()[1]}"
        with pytest.raises(InputError, match=f"--scheduler {address}: .*; allowed: ") as refused:
            scheduler.connected(address)
    assert why in str(refused.value) or (listens and "no Dask scheduler answers there" in str(refused.value))


def test_a_scheduler_with_another_dask_is_refused(
    machines: Machines, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(scheduler, "version_of", lambda _package: "1.0")
    with pytest.raises(InputError, match=r"has distributed \S+ \(here 1\.0\)"):
        scheduler.connected(machines.address)


def test_tls_with_files_that_are_not_there_is_said() -> None:
    nowhere = {
        f"distributed.comm.tls.{name}": "/nowhere" for name in ("ca-file", "client.cert", "client.key")
    }
    with (
        dask.config.set(nowhere),
        pytest.raises(InputError, match=r"the files of Dask's settings distributed\.comm\.tls"),
    ):
        scheduler.connected("tls://127.0.0.1:8786")


def test_tls_without_certificates_is_said() -> None:
    with pytest.raises(InputError, match="no certificates for TLS here"):
        scheduler.connected("tls://127.0.0.1:8786")
