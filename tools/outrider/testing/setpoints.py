"""Set-points that a vehicle was sent, or would have been, with assertions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mavlink_bridge.messages import SetpointLocal
from outrider.shadow.setpoints import Course, Facts, course, facts, steps
from outrider.testing.golden import Golden

_RATE_WINDOW_US = 1_000_000
"""Interval over which a rate is counted (µs)."""


class Setpoints:
    """Sequence of SET_POSITION_TARGET_LOCAL_NED with times (µs), for the vehicle called ``name``.

    ``golden`` holds its golden files.
    """

    def __init__(self, name: str, sent: Sequence[tuple[int, SetpointLocal]], golden: Golden) -> None:
        self.name, self.messages, self._golden = name, tuple(sent), golden

    def __len__(self) -> int:
        return len(self.messages)

    @property
    def course(self) -> Course:
        """Set-points as arrays: NED, SI units."""
        return course(self.messages)

    @property
    def facts(self) -> Facts:
        """Largest step, speed and acceleration, masks, frames, gaps."""
        return facts(self.messages)

    def assert_continuous(
        self, *, step: float = 0.3, speed: float | None = None, acceleration: float | None = None
    ) -> None:
        """Assert that all values are finite, and that no limit is exceeded.

        ``step`` (m) limits the distance between two positions that follow each other within 0.1 s; ``speed``
        (m/s) and ``acceleration`` (m/s²) limit the magnitudes.
        """
        __tracebackhide__ = True
        found = self.facts
        if not found.setpoints:
            raise AssertionError(f"{self.name}: no set-points")
        if not found.finite:
            time, _ = next((t, m) for t, m in self.messages if not facts([(t, m)]).finite)
            raise AssertionError(
                f"{self.name}: a set-point is not finite, {self._since(time):.2f} s after the first"
            )
        of = self.course
        self._below("m from one position to the next", np.append(0.0, steps(of)), step)
        self._below("m/s", np.linalg.norm(of.velocities, axis=1), speed)
        self._below("m/s²", np.linalg.norm(of.accelerations, axis=1), acceleration)

    def assert_rate(self, *, at_least: float, gap: float = 0.5) -> None:
        """Assert ``at_least`` set-points in every second, and no pause longer than ``gap`` (s).

        The seconds are counted from the first set-point; an incomplete last one is ignored. For less than a
        second of set-points, ``at_least`` limits their mean rate.
        """
        __tracebackhide__ = True
        times = self.course.times
        if len(times) < 2:
            raise AssertionError(f"{self.name}: {len(times)} set-points have no rate")
        longest = int(np.diff(times).argmax())
        seconds = (times[longest + 1] - times[longest]) * 1e-6
        if seconds > gap:
            begins = self._since(times[longest])
            raise AssertionError(
                f"{self.name}: no set-point for {seconds:.2f} s, from {begins:.2f} s after the first on; "
                f"{gap:g} s are allowed"
            )
        if (np.diff(times) < 0).any():
            raise AssertionError(f"{self.name}: the times of the set-points go back")
        counts = np.bincount((times - times[0]) // _RATE_WINDOW_US)[:-1]
        whole = (len(times) - 1) / max((times[-1] - times[0]) * 1e-6, 1e-6)
        if not len(counts) and whole < at_least:
            raise AssertionError(f"{self.name}: {whole:.1f} set-points a second; {at_least:g} are asked for")
        if len(counts) and counts.min() < at_least:
            raise AssertionError(
                f"{self.name}: {counts.min()} set-points in the second that begins {counts.argmin()} s "
                f"after the first; at least {at_least:g} are asked for"
            )

    def assert_golden(self, name: str, *, within: float = 0.01) -> None:
        """Assert the same set-points, at the same times (ms), as the golden file ``name`` of the test.

        Positions may differ by ``within`` m, velocities by ``within`` m/s, yaw by ``within`` rad,
        accelerations by 10 times ``within`` m/s². With ``--update-golden`` the file is written instead.
        """
        __tracebackhide__ = True
        self._golden.check(name, self.name, self.course, within)

    def _below(self, what: str, values: np.ndarray, bound: float | None) -> None:
        __tracebackhide__ = True
        known = np.where(np.isfinite(values), values, 0.0)
        if bound is not None and len(known) and known.max() > bound:
            at = int(known.argmax())
            raise AssertionError(
                f"{self.name}: {known[at]:.3f} {what}, {self._since(self.messages[at][0]):.2f} s after the "
                f"first set-point; {bound:g} are allowed"
            )

    def _since(self, time: int) -> float:
        return (time - self.messages[0][0]) * 1e-6
