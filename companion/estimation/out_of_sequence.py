"""Out-of-sequence buffer: the last seconds of a track, so that late measurements are inserted in order.

Measurements are sorted by the times at which they were true, each with the filter state after it. A late
measurement is inserted, and all later ones are processed again, gate and hypotheses included: the result is
bit-identical to the result of an arrival in order.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right

from companion.estimation.estimator import Belief, Estimator, Measured
from companion.estimation.sender_clock import TrackTime


class OutOfSequenceBuffer:
    """Measurements of at least the last ``window`` µs, at most twice that, and the filter state before them.

    ``belief``: latest filter state, None before the first measurement; ``too_late``: number of measurements
    refused because they were from before the window.
    """

    __slots__ = (
        "_before",
        "_beliefs",
        "_estimator",
        "_measured",
        "_times",
        "_window",
        "belief",
        "too_late",
    )

    def __init__(self, estimator: Estimator, window: int) -> None:
        self._estimator = estimator
        self._window = window
        self._before: Belief | None = None
        self._times: list[int] = []
        self._measured: list[Measured] = []
        self._beliefs: list[Belief] = []
        self.belief: Belief | None = None
        self.too_late = 0

    def put(self, dated: TrackTime, z: Measured) -> bool:
        """Add a measurement ``z``; return whether it became part of the filter state.

        A measurement from before the window is refused and counted. A measurement with the same sender's
        stamp as an earlier one is a duplicate: it is ignored, and the answer is that of the earlier one.
        """
        times, (time, _) = self._times, dated
        if times and time <= times[-1]:
            if time < times[-1] - self._window:
                self.too_late += 1
                return False
            return self._insert(dated, z)
        before = self.belief
        self.belief = belief = self._estimator.after(before, time, z)
        times.append(time)
        self._measured.append(z)
        self._beliefs.append(belief)
        # Removed in batches; measurements from before the window are never processed again.
        if times[0] < time - 2 * self._window:
            self._forget()
        return before is None or belief.refused == before.refused

    def _insert(self, dated: TrackTime, z: Measured) -> bool:
        """Insert a late measurement; return whether it became part of the filter state."""
        times, time = self._times, dated.time
        place = bisect_right(times, time)
        if dated.stamped and place > 0 and times[place - 1] == time:
            return self._accepted(place - 1)
        times.insert(place, time)
        self._measured.insert(place, z)
        self._replay(place)
        return self._accepted(place)

    def _replay(self, first: int) -> None:
        """Process the measurements from index ``first`` on, again or for the first time."""
        beliefs = self._beliefs
        del beliefs[first:]
        belief = beliefs[-1] if first > 0 else self._before
        for time, z in zip(self._times[first:], self._measured[first:], strict=True):
            belief = self._estimator.after(belief, time, z)
            beliefs.append(belief)
        self.belief = belief

    def _accepted(self, place: int) -> bool:
        """Return whether the gate accepted the measurement at index ``place``."""
        before = self._beliefs[place - 1] if place > 0 else self._before
        return before is None or self._beliefs[place].refused == before.refused

    def _forget(self) -> None:
        """Remove measurements from before the window: none is inserted between them any more."""
        old = bisect_left(self._times, self._times[-1] - self._window)
        self._before = self._beliefs[old - 1]
        del self._times[:old], self._measured[:old], self._beliefs[:old]
