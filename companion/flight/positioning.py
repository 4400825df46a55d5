"""Whether the own autopilot still knows where it is, by its GPS and its estimator, and how far it may be off.

Without GPS an estimator coasts on its accelerometers and says where it believes to be as ever; that it has no
position it says after 5 s (PX4) or 7 s (ArduPilot), and then its failsafe acts. GPS_RAW_INT (24) tells of the
loss at once. So do the flags of EKF_STATUS_REPORT (193) and ESTIMATOR_STATUS (230), and a ratio of innovation
to gate of 1 and more: then GPS is refused, and it coasts as well.
"""

from __future__ import annotations

from mavlink_bridge.messages import EkfStatus, EstimatorStatus, GpsRaw, Message

_FIX_3D = 3
_ABSOLUTE = 0x10
"""ESTIMATOR_POS_HORIZ_ABS, the same in both messages."""
_REFUSES = 1.0
_COASTING = 0.1
"""m/s²: two standard deviations of an acceleration that is wrong while nothing corrects it."""
_FURTHEST = 10.0
"""m; beyond, nobody keeps away from it for its own sake any more."""
_FADES = 2_000_000
"""µs after which an estimate that has GPS again has come back to it."""


class Positioning:
    """Of one autopilot; messages are dated by ``tick``. A vehicle that never had GPS, as with cameras, misses
    none."""

    def __init__(self) -> None:
        self._fix: bool | None = None
        self._absolute: bool | None = None
        self._refused = False
        self._accuracy: float | None = None
        self._good: float | None = None
        self._since: int | None = None
        self._until: int | None = None
        self._worst = 0.0
        self._now = 0

    def receive(self, message: Message) -> None:
        """One of its messages."""
        if isinstance(message, GpsRaw):
            fix = message.fix_type >= _FIX_3D
            self._fix = fix if fix or self._fix is not None else None
        elif isinstance(message, EkfStatus | EstimatorStatus):
            absolute = bool(message.flags & _ABSOLUTE)
            self._absolute = absolute if absolute or self._absolute is not None else None
            # NaN: not tested.
            self._refused = absolute and message.horizontal >= _REFUSES
            if isinstance(message, EstimatorStatus):
                self._accuracy = message.horizontal_accuracy

    def tick(self, now: int) -> None:
        """It is ``now`` (µs)."""
        self._now = now
        if self.trouble:
            self._since = now if self._since is None else self._since
            self._until = None
            self._worst = max(self._worst, self._estimated())
            return
        self._good = self._accuracy
        if self._since is not None:
            self._until = now + _FADES if self._until is None else self._until
            if now >= self._until:
                self._since, self._until, self._worst = None, None, 0.0

    @property
    def trouble(self) -> str:
        """Why it does not know where it is, empty if it does."""
        if self._fix is False:
            return "GPS is lost"
        if self._absolute is False:
            return "Estimator has no position"
        return "Estimator refuses GPS" if self._refused else ""

    @property
    def radius(self) -> float:
        """How far (m) it may be from where it says that it is, beyond what is usual."""
        return min(self._worst, _FURTHEST)

    def _estimated(self) -> float:
        """By time, or by what the estimator says of itself, if that is more."""
        since = self._now if self._since is None else self._since
        coasted = 0.5 * _COASTING * (1e-6 * (self._now - since)) ** 2
        if self._accuracy is None or self._good is None or not self._accuracy >= self._good:
            return coasted
        return max(coasted, 2.0 * (self._accuracy - self._good))
