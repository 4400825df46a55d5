"""Period of the repetition of the newest plan: shorter while most transmissions of others are lost.

The received share is the share of the last epochs of which a plan arrived. With n transmissions in an epoch
and independent losses q it is 1 - q^n. A vehicle knows the loss of what it receives only, so it takes the
loss of what it sends for the same.

Where links are overloaded, more transmissions are lost with each one that is added, and the share does not
rise. Then the vehicle returns to the usual period for some time: it adds no load for good.
"""

from __future__ import annotations

from math import ceil

from companion.config.certified import CertifiedConfig

EPOCHS = 10
"""Number of epochs of the received share."""
_HEAVY, _LIGHT = 0.8, 0.75
"""Loss of transmissions above which the period becomes shorter, and below which it returns."""
_TRIAL_US = 4_000_000
"""Time (µs) after which a shorter period must have raised the received share."""
_AGAIN_US = 30_000_000
"""Time (µs) after which it is judged again."""
_RAISED = 0.3
"""Part of the rise with independent losses below which a link counts as overloaded."""
_REST_US = 15_000_000
"""Time (µs) with the usual period after that."""


class Repetition:
    """Repetition of one vehicle's newest plan; ``period`` (µs): between two transmissions, now."""

    def __init__(self, config: CertifiedConfig) -> None:
        self._usual = config.repeat_us
        self._factor = config.repeat_in_loss
        self._number = ceil(config.epoch_us / config.repeat_us)
        self._shorter = round(config.repeat_us / config.repeat_in_loss)
        self._more = ceil(config.epoch_us / self._shorter)
        self.period = self._usual
        self._least = 1.0
        self._tried_until = self._rests_until = 0

    def update(self, now: int, share: float | None) -> None:
        """Set the period by the received ``share`` at ``now`` (µs); None: it is not known."""
        if self._factor == 1.0:
            return
        if self.period == self._usual:
            if share is not None and now >= self._rests_until and share < 1.0 - _HEAVY**self._number:
                self.period = self._shorter
                self._least, self._tried_until = share, now + _TRIAL_US
        elif share is None or share > 1.0 - _LIGHT**self._more:
            self.period = self._usual
        else:
            # The share decreases further for some time where the loss has only begun.
            self._least = min(self._least, share)
            if now >= self._tried_until:
                self._tried_until = now + _AGAIN_US
                if share < self._least + _RAISED * self._rise():
                    self.period, self._rests_until = self._usual, now + _REST_US

    def _rise(self) -> float:
        """Return by how much the shorter period raises the least share where losses are independent."""
        lost = 1.0 - self._least
        return float(lost - lost ** (self._more / self._number))
