"""Tasks that wait for a worker. One that was lost is tried once more when all others have ended: what takes
its worker down again stays lost."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable

from outrider.sweep.tasks import Task


class Backlog:
    """The tasks that are not begun; its length is how many may begin now."""

    def __init__(self, tasks: Iterable[Task]) -> None:
        self._waiting = deque(tasks)
        self._again: deque[Task] = deque()
        self._tried: set[tuple[str, int]] = set()

    def __len__(self) -> int:
        return len(self._waiting)

    def goes_on(self, busy: int) -> bool:
        """Whether anything is left, with so many tasks ``busy``. With none the lost ones come up again."""
        if not self._waiting and not busy:
            self._waiting, self._again = self._again, deque()
        return bool(self._waiting or self._again or busy)

    def take(self) -> Task:
        """The next one to begin. IndexError without one."""
        return self._waiting.popleft()

    def lost(self, task: Task) -> None:
        """It was begun, and its worker is gone."""
        if task.run not in self._tried:
            self._tried.add(task.run)
            self._again.append(task)

    def put_back(self, task: Task) -> None:
        """It was never begun, after all."""
        self._waiting.appendleft(task)
