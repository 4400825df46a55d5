"""What a `Cluster` makes of answers that are lost, late or from another life, with a client that plays Dask:
moments that cannot be met with real processes at will."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import pytest

from outrider.sweep import cluster, dask_tasks
from outrider.sweep.cluster import Cluster
from outrider.sweep.tasks import Entry, Task

Answer = Callable[[], Any]


class Future:
    """One that has ended; ``answer`` gives its result, or raises."""

    def __init__(self, key: str, answer: Answer, status: str = "finished") -> None:
        self.key, self._answer, self.status = key, answer, status

    def add_done_callback(self, action: Callable[[Any], None]) -> None:
        action(self)

    def result(self, timeout: float) -> Any:
        return self._answer()

    def release(self) -> None:
        pass


class Client:
    """``flies`` answers a run at an address; ``there`` is asked who is there at every look."""

    def __init__(self, flies: Callable[[str, Entry], Any], there: Callable[[], dict[str, int]]) -> None:
        self._flies, self._there = flies, there
        self.scheduler = self
        self.lives = 0

    def ncores(self) -> None:
        pass

    def sync(self, _function: Any, **_options: Any) -> dict[str, int]:
        return self._there()

    def submit(self, function: Any, *values: Any, key: str, workers: list[str], pure: bool) -> Future:
        if function is eval:
            self.lives += 1
            me = f"life {self.lives}"
            return Future(key, lambda: {"me": me, "versions": dask_tasks.required_versions()})
        task = Task(**json.loads(values[-1]))
        entry = Entry(*task.run, "done", None, {"flown_at": values[0]}, 0.0)
        return Future(key, lambda: self._flies(workers[0], entry))

    def run(self, *_values: Any, **_options: Any) -> None:
        pass

    def close(self) -> None:
        pass


@pytest.fixture(autouse=True)
def _quickly(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("_TICK_S", "_POLL_PERIOD_S", "_FETCH_TIMEOUT_S"):
        monkeypatch.setattr(cluster, name, 0.0)


def flown(client: Client, monkeypatch: pytest.MonkeyPatch, most: int = 200) -> list[Entry]:
    """Three runs; AssertionError if that takes more than so many looks around."""
    monkeypatch.setattr(cluster, "connected", lambda _address: client)
    entries: list[Entry] = []
    ticks: list[None] = []

    def tick() -> None:
        ticks.append(None)
        assert len(ticks) < most

    with Cluster("tcp://x:1", "m:f", 60.0) as those:
        those.work([Task("key", seed) for seed in range(3)], entries.append, tick)
    return entries


def test_an_answer_that_has_gone_with_its_worker_is_a_lost_run(monkeypatch: pytest.MonkeyPatch) -> None:
    looks: list[None] = []

    def there() -> dict[str, int]:
        looks.append(None)
        return {"tcp://a:1": 1} if len(looks) < 10 else {"tcp://b:1": 1}

    def flies(address: str, entry: Entry) -> Any:
        if address == "tcp://a:1" and entry.seed == 1:
            raise TimeoutError
        return {"entry": entry._asdict()}

    entries = flown(Client(flies, there), monkeypatch)
    assert [(e.seed, e.status) for e in entries] == [(0, "done"), (1, "lost"), (2, "done"), (1, "done")]
    assert entries[1].what == "its Dask worker tcp://a:1 is gone"
    assert len(looks) >= 10


def test_a_slow_answer_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []

    def flies(_address: str, entry: Entry) -> Any:
        asked.append(entry.seed)
        if asked.count(1) in range(1, 5) and entry.seed == 1:
            raise TimeoutError
        return {"entry": entry._asdict()}

    entries = flown(Client(flies, lambda: {"tcp://a:1": 3}), monkeypatch)
    assert sorted((e.seed, e.status) for e in entries) == [(0, "done"), (1, "done"), (2, "done")]


def test_another_life_of_a_worker_is_asked_who_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    restarts: list[None] = []

    def flies(_address: str, entry: Entry) -> Any:
        if entry.seed == 1 and not restarts:
            restarts.append(None)
            return {"restarted": True}
        return {"entry": entry._asdict()}

    client = Client(flies, lambda: {"tcp://a:1": 1})
    entries = flown(client, monkeypatch)
    assert [(e.seed, e.status) for e in entries] == [(0, "done"), (1, "lost"), (2, "done"), (1, "done")]
    assert entries[1].what == "its Dask worker tcp://a:1 was restarted"
    assert client.lives == 2
    assert entries[-1].summary == {"flown_at": "life 2"}


def test_a_sweep_that_is_over_gets_no_new_process() -> None:
    dask_tasks.dismiss("over")
    assert dask_tasks.fly(dask_tasks.WORKER_ID, "over", "m:f", 1.0, "{}") == {"unable": "its sweep is over"}
