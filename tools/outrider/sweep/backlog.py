"""Queue of tasks that wait for a worker.

A lost task is tried once more after all others have ended; a task that ends its worker again stays lost.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable

from outrider.sweep.tasks import Task


class Backlog:
    """Tasks that have not been started; the length is the number that may start now."""

    def __init__(self, tasks: Iterable[Task]) -> None:
        self._waiting = deque(tasks)
        self._again: deque[Task] = deque()
        self._retried: set[tuple[str, int]] = set()

    def __len__(self) -> int:
        return len(self._waiting)

    def goes_on(self, busy: int) -> bool:
        """Return whether any task is left, while ``busy`` tasks run.

        If none waits and none runs, the lost tasks wait again.
        """
        if not self._waiting and not busy:
            self._waiting, self._again = self._again, deque()
        return bool(self._waiting or self._again or busy)

    def take(self) -> Task:
        """Return the next task. Raises IndexError if there is none."""
        return self._waiting.popleft()

    def lost(self, task: Task) -> None:
        """Schedule a second attempt of a started task whose worker is gone, unless it was lost before."""
        if task.run not in self._retried:
            self._retried.add(task.run)
            self._again.append(task)

    def put_back(self, task: Task) -> None:
        """Put back a task that was not started after all."""
        self._waiting.appendleft(task)
