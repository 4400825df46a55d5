"""Position quality of the own autopilot, from its GPS and its estimator, and a bound on the error.

Without GPS an estimator dead-reckons on its accelerometers and reports its estimated position as before; it
reports the loss of position after 5 s (PX4) or 7 s (ArduPilot), and then the autopilot's failsafe acts.
GPS_RAW_INT (24) shows the loss at once. The flags of EKF_STATUS_REPORT (193) and ESTIMATOR_STATUS (230) show
it too. A ratio of innovation to gate of 1 or more means that the estimator rejects GPS and dead-reckons.
"""

from __future__ import annotations

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import EkfStatus, EstimatorStatus, GpsRaw, Message

_REJECTS = 1.0
"""Ratio of innovation to gate from which the estimator rejects GPS."""
_DEAD_RECKONING_ERROR = 0.1
"""m/s²: two standard deviations of the acceleration error of dead reckoning."""
_LARGEST_RADIUS = 10.0
"""m; upper bound of the radius: distances are not widened further."""
_CONVERGENCE_US = 2_000_000
"""µs from the return of GPS until the estimate has converged to it."""


class Positioning:
    """Position quality of one autopilot. A message counts as received at the time of the last ``tick``.

    The loss of the fix, or of the estimator's absolute position, is reported only after it was present once:
    a vehicle with cameras may have no GPS at all.
    """

    def __init__(self) -> None:
        self._fix: bool | None = None
        self._absolute: bool | None = None
        self._refused = False
        self._accuracy: float | None = None
        self._accuracy_before: float | None = None
        self._lost_at: int | None = None
        self._recovered_at: int | None = None
        self._largest_error = 0.0
        self._now = 0

    def receive(self, message: Message) -> None:
        """Receive a message of the autopilot."""
        if isinstance(message, GpsRaw):
            fix = message.fix_type >= mavlink.GPS_FIX_TYPE_3D_FIX
            self._fix = fix if fix or self._fix is not None else None
        elif isinstance(message, EkfStatus | EstimatorStatus):
            # EKF_POS_HORIZ_ABS of EKF_STATUS_REPORT is the same bit.
            absolute = bool(message.flags & mavlink.ESTIMATOR_POS_HORIZ_ABS)
            self._absolute = absolute if absolute or self._absolute is not None else None
            # ``horizontal`` is NaN if the estimator has not tested the innovation; NaN fails the comparison.
            self._refused = absolute and message.horizontal >= _REJECTS
            if isinstance(message, EstimatorStatus):
                self._accuracy = message.horizontal_accuracy

    def tick(self, now: int) -> None:
        """Set the time to ``now`` (µs) and update the radius."""
        self._now = now
        if self.trouble:
            self._lost_at = now if self._lost_at is None else self._lost_at
            self._recovered_at = None
            self._largest_error = max(self._largest_error, self._estimated())
            return
        self._accuracy_before = self._accuracy
        if self._lost_at is not None:
            self._recovered_at = now + _CONVERGENCE_US if self._recovered_at is None else self._recovered_at
            if now >= self._recovered_at:
                self._lost_at, self._recovered_at, self._largest_error = None, None, 0.0

    @property
    def trouble(self) -> str:
        """Reason why the vehicle's position is not reliable, empty if it is."""
        if self._fix is False:
            return "GPS is lost"
        if self._absolute is False:
            return "Estimator has no position"
        return "Estimator refuses GPS" if self._refused else ""

    @property
    def radius(self) -> float:
        """Additional uncertainty (m) of the reported position.

        It is 0 with good positioning, grows during ``trouble`` to 10 m at most, and is 0 again 2 s after it.
        """
        return min(self._largest_error, _LARGEST_RADIUS)

    def _estimated(self) -> float:
        """Return the error (m) of dead reckoning since the loss of position.

        It is computed from the elapsed time. If twice the growth of the accuracy (m) that the estimator
        reports is larger, it is that growth times two.
        """
        lost_at = self._now if self._lost_at is None else self._lost_at
        dead_reckoned = 0.5 * _DEAD_RECKONING_ERROR * (1e-6 * (self._now - lost_at)) ** 2
        if (
            self._accuracy is None
            or self._accuracy_before is None
            or not self._accuracy >= self._accuracy_before
        ):
            return dead_reckoned
        return max(dead_reckoned, 2.0 * (self._accuracy - self._accuracy_before))
