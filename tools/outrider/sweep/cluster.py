"""Workers of a Dask scheduler, with the rules of the local `Pool`.

A run whose worker is lost is reported and tried once more at the end. Each task is bound to one worker. A
worker that joins later, or after a restart, must first report its identity and versions; if the versions
differ, it gets no tasks. No run is started a second time unnoticed, as Dask would do.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from threading import Thread
from typing import Any, NamedTuple
from uuid import uuid4

from dask.typing import Key
from distributed import Future, KilledWorker
from distributed.client import FutureCancelledError

from outrider.errors import InputError
from outrider.sweep import dask_tasks
from outrider.sweep.backlog import Backlog
from outrider.sweep.scheduler import connected
from outrider.sweep.sources import differences
from outrider.sweep.tasks import AbandonedError, Ended, Entry, Task

PATIENCE_S = 300.0
"""Time (s) that a sweep waits for a worker."""
_IDENTIFY = "__import__('outrider.sweep.dask_tasks', fromlist=['identify']).identify()"
"""Expression that a new worker evaluates.

It is a text, because a Dask worker ends if it cannot import a function that it receives, and outrider may not
be installed there.
"""
_TICK_S, _POLL_PERIOD_S, _FETCH_TIMEOUT_S, _CLOSE_TIMEOUT_S, _REPLY_TIMEOUT_S = 0.5, 1.0, 2.0, 3.0, 20.0


@dataclass
class _Site:
    """Dask worker.

    ``me`` is None until it has reported its identity; ``refused`` is the reason why it gets no tasks.
    """

    address: str
    threads: int
    me: str | None = None
    refused: str | None = None
    busy: int = 0

    @property
    def free(self) -> bool:
        """Whether the worker can take a task."""
        return self.me is not None and self.refused is None and self.busy < self.threads


class _Flight(NamedTuple):
    task: Task | None
    """None: the worker is asked for its identity."""
    site: _Site
    future: Future[Any]
    since: float


class Cluster:
    """Present and future workers of the scheduler at ``address``; a context manager.

    Each worker flies as many runs at a time as it has threads, by ``run``, a ``module:function``. Raises
    InputError if no scheduler answers.
    """

    def __init__(self, address: str, run: str, wall_limit_s: float, patience_s: float = PATIENCE_S) -> None:
        self._address, self._run, self._limit, self._patience = address, run, wall_limit_s, patience_s
        self._sweep = uuid4().hex
        self._versions = dask_tasks.required_versions()
        self._sites: dict[str, _Site] = {}
        self._flights: dict[Key, _Flight] = {}
        self._answers: SimpleQueue[Future[Any]] = SimpleQueue()
        self._looked = self._served = -float("inf")
        self._flown = self._said = False
        self._client = connected(address)

    def __enter__(self) -> Cluster:
        return self

    def __exit__(self, *_: object) -> None:
        # Daemon threads with a time limit: a worker that hangs must not keep the sweep from ending.
        for goodbye in (self._dismiss, self._client.close):
            thread = Thread(target=_quietly, args=(goodbye,), daemon=True)
            thread.start()
            thread.join(_CLOSE_TIMEOUT_S)

    def work(self, tasks: Iterable[Task], ended: Ended, tick: Callable[[], None] = lambda: None) -> None:
        """Run all tasks, as `Pool.work` does.

        Raises InputError if all workers are refused before any run has ended, AbandonedError if the scheduler
        is gone or there has been no accepted worker for ``patience_s``.
        """
        backlog = Backlog(tasks)
        self._served = time.monotonic()
        while backlog.goes_on(sum(flight.task is not None for flight in self._flights.values())):
            self._look(backlog, ended)
            for site in self._sites.values():
                while backlog and site.free:
                    self._begin(site, backlog.take())
            self._receive(backlog, ended)
            tick()

    def _look(self, backlog: Backlog, ended: Ended) -> None:
        """Check once a second which workers have joined and which are gone."""
        now = time.monotonic()
        if now - self._looked < _POLL_PERIOD_S:
            return
        self._looked = now
        there = self._there()
        for flight in list(self._flights.values()):
            if flight.site.address not in there:
                self._lose(flight, f"its Dask worker {flight.site.address} is gone", backlog, ended)
        for address in self._sites.keys() - there.keys():
            del self._sites[address]
        for address, threads in there.items():
            if address not in self._sites:
                self._sites[address] = site = _Site(address, threads)
                self._submit(site, None, eval, _IDENTIFY)
        self._wait(now)

    def _there(self) -> dict[str, int]:
        """Return the number of threads of each worker, by its address."""
        scheduler = self._client.scheduler
        try:
            return dict(self._client.sync(scheduler.ncores, workers=None, callback_timeout=_REPLY_TIMEOUT_S))
        except Exception:
            # Any exception that Dask raises for a connection that has ended or does not answer.
            raise self._abandoned("has gone") from None

    def _wait(self, now: float) -> None:
        """Check whether a worker is available, and for how long there has been none."""
        sites = self._sites.values()
        silent = any(site.me is None and site.refused is None for site in sites)
        if any(site.me is not None and site.refused is None for site in sites):
            self._served, self._said = now, False
        elif sites and not silent and not self._flown:
            lines = (f"{site.address}: {site.refused}" for site in sites)
            raise InputError(*(f"--scheduler {self._address}: no worker can fly: {line}" for line in lines))
        elif now - self._served >= self._patience:
            raise self._abandoned(f"has had no worker for {self._patience:g} s")
        elif not silent and not self._said:
            self._said = True
            start = f"dask worker {self._address} --host OWN-ADDRESS"
            _say(f"no worker at {self._address}; waiting for one: {start}")

    def _begin(self, site: _Site, task: Task) -> None:
        site.busy += 1
        values = (site.me, self._sweep, self._run, self._limit, json.dumps(task._asdict()))
        self._submit(site, task, dask_tasks.fly, *values)

    def _submit(self, site: _Site, task: Task | None, function: Callable[..., Any], *values: Any) -> None:
        name = "identify" if task is None else f"fly-{task.key}-{task.seed}"
        future = self._client.submit(
            function, *values, key=f"{name}-{uuid4().hex}", workers=[site.address], pure=False
        )
        self._flights[future.key] = _Flight(task, site, future, time.monotonic())
        future.add_done_callback(self._answers.put)

    def _receive(self, backlog: Backlog, ended: Ended) -> None:
        """Process the answers that have arrived; wait for a while if there are none."""
        wait = _TICK_S
        with suppress(Empty):
            while True:
                future = self._answers.get(timeout=wait)
                wait = 0.0
                flight = self._flights.get(future.key)
                if flight is not None and not self._answered(flight, backlog, ended):
                    # Retried at the next call: `_look` must run in between to detect workers that are gone.
                    self._answers.put(future)
                    return

    def _answered(self, flight: _Flight, backlog: Backlog, ended: Ended) -> bool:
        """Process the answer of ``flight``, and return whether it could be fetched."""
        answer = self._fetched(flight.future)
        if answer is not None:
            self._take(answer, flight, backlog, ended)
        return answer is not None

    def _fetched(self, future: Future[Any]) -> dict[str, Any] | None:
        """Return the answer of a worker; None if it is slow, or was lost with a dead worker (see `_look`)."""
        try:
            answer: dict[str, Any] = future.result(timeout=_FETCH_TIMEOUT_S)
        except FutureCancelledError:
            raise self._abandoned("has gone") from None
        except KilledWorker:
            return {"restarted": True}
        except Exception as error:
            if isinstance(error, TimeoutError) and future.status != "error":
                return None
            # Raised on the worker: most likely outrider is missing there, or has another version.
            return {"unable": f"{type(error).__name__}: {' '.join(str(error).split())}"}
        return answer

    def _take(self, answer: dict[str, Any], flight: _Flight, backlog: Backlog, ended: Ended) -> None:
        task, site = flight.task, flight.site
        if "restarted" in answer:
            # Dask has started the task again in the restarted worker, which must now report its identity.
            if self._sites.get(site.address) is site:
                del self._sites[site.address]
            self._lose(flight, f"its Dask worker {site.address} was restarted", backlog, ended)
            return
        self._drop(flight)
        if "unable" in answer:
            if task is not None:
                backlog.put_back(task)
            self._refuse(site, f"cannot fly: {answer['unable']}")
        elif task is not None:
            entry = Entry(**answer["entry"])
            self._flown = True
            if entry.status == "lost":
                backlog.lost(task)
            ended(entry)
        elif wrong := differences(answer["versions"], self._versions, "here"):
            self._refuse(site, f"{', '.join(wrong)}; allowed: the same there and here")
        else:
            site.me = answer["me"]

    def _lose(self, flight: _Flight, what: str, backlog: Backlog, ended: Ended) -> None:
        self._drop(flight)
        if flight.task is not None:
            backlog.lost(flight.task)
            wall_s = round(time.monotonic() - flight.since, 3)
            ended(Entry(*flight.task.run, "lost", what, None, wall_s))

    def _drop(self, flight: _Flight) -> None:
        del self._flights[flight.future.key]
        flight.site.busy -= flight.task is not None
        flight.future.release()  # type: ignore[no-untyped-call]

    def _refuse(self, site: _Site, why: str) -> None:
        if site.refused is None:
            site.refused = why
            _say(f"refused: {site.address}: {why}")

    def _abandoned(self, what: str) -> AbandonedError:
        return AbandonedError(f"the scheduler {self._address} {what}")

    def _dismiss(self) -> None:
        """End the processes that still fly for this sweep."""
        addresses = [site.address for site in self._sites.values() if site.me is not None]
        if addresses:
            self._client.run(dask_tasks.dismiss, self._sweep, workers=addresses, on_error="ignore")


def _quietly(action: Callable[[], object]) -> None:
    """Run ``action`` and ignore errors: the scheduler may be gone."""
    with suppress(Exception):
        action()


def _say(words: str) -> None:
    sys.stderr.write(f"{words}\n")
    sys.stderr.flush()
