"""Pace of a simulation: as fast as possible, unless a live view commands otherwise."""

from __future__ import annotations

import time
from collections.abc import Callable

from outrider.scene.view_commands import ViewCommands

LEASE = 2.0
"""Time for which a command applies after it was received (s)."""
STEP = 100_000
"""Simulated time (µs) that a paused simulation advances for each requested single step."""
_NAP_S = 0.02


class Pace:
    """Pace by the commands of a view; ``clock``: wall clock (s); ``nap``: function that sleeps (s)."""

    def __init__(
        self, clock: Callable[[], float] = time.monotonic, nap: Callable[[float], None] = time.sleep
    ) -> None:
        self._clock, self._nap = clock, nap
        self._commands = ViewCommands()
        self._said = -LEASE
        self._steps: int | None = None
        self._until = 0
        self._anchor: tuple[float, int, float | None] | None = None

    def receive(self, commands: ViewCommands, now: int) -> None:
        """Process received commands, while the simulation is at ``now`` (µs)."""
        if self._steps is None:
            self._steps = commands.steps
        if commands.steps > self._steps:
            self._until = max(self._until, now) + STEP * (commands.steps - self._steps)
            self._steps = commands.steps
        self._commands, self._said = commands, self._clock()

    def wait(self, now: int, listen: Callable[[], None]) -> None:
        """Wait before the simulation continues from ``now`` (µs), as long as the commands require.

        ``listen()`` is called after each nap to receive new commands.
        """
        while (rest := self._rest(now)) > 0.0:
            self._nap(min(rest, _NAP_S))
            listen()

    def _rest(self, now: int) -> float:
        """Return the time to wait (s) by the present commands; not positive for none."""
        clock, commands = self._clock(), self._commands
        if clock - self._said > LEASE:
            self._anchor = None
            return 0.0
        if commands.paused:
            self._anchor = None
            return 0.0 if now < self._until else _NAP_S
        self._until = 0
        if commands.speed is None:
            self._anchor = None
            return 0.0
        if self._anchor is None or self._anchor[2] != commands.speed:
            self._anchor = clock, now, commands.speed
        since, begin, speed = self._anchor
        due = since + 1e-6 * (now - begin) / commands.speed
        if due < clock - 0.5:
            # A simulation more than 0.5 s late does not run faster afterwards to catch up.
            self._anchor = clock, now, speed
        return due - clock
