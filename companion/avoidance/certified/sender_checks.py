"""Checks of the senders of plans and statements: their fleet frame, their settings and their clock."""

from __future__ import annotations

from collections.abc import Iterable

from companion.avoidance.certified.fingerprint import FleetIdentity
from companion.config.certified import CertifiedConfig
from companion.values.refused_senders import RefusedSenders
from mavlink_bridge.wire.agreements import Statement
from mavlink_bridge.wire.plan import WirePlan

_OLDEST, _AHEAD = 12, 4
"""Largest time (epochs) by which a received plan may begin before now, and after."""
_REPORTED_US = 5_000_000
"""Time (µs) after a message of another fleet, or of a wrong clock, during which its sender is reported.

In this time no statement of a sender of another fleet is accepted, and no plan, unless it is expected.
"""


class SenderChecks:
    """Checks of what was received for a ``fleet`` whose plans have ``steps`` knots.

    A sender that fails one is reported for some time.
    """

    def __init__(self, config: CertifiedConfig, steps: int, fleet: FleetIdentity) -> None:
        self._config, self._steps, self._fleet = config, steps, fleet
        self._foreign: dict[int, int] = {}
        self._other_knots: dict[int, int] = {}
        self._differing: dict[int, int] = {}
        self._early: dict[int, int] = {}

    def fits(self, now: int, system: int, plan: WirePlan) -> bool:
        """Return whether a plan is in the fleet's frame, on its knots, and of about ``now`` (µs)."""
        epoch = self._config.epoch_us
        if plan.origin != self._fleet.origin:
            self._foreign[system] = now
            return False
        if plan.dt != self._config.dt_us or len(plan.accelerations) != self._steps or plan.epoch % epoch:
            self._other_knots[system] = now
            return False
        return -_OLDEST * epoch <= plan.epoch - now and self._begun(now, system, plan.epoch)

    def same_fleet(self, now: int, system: int, statement: Statement) -> bool:
        """Return whether the sender of ``statement``, received at ``now`` (µs), has the fleet's settings."""
        if statement.fingerprint == self._fleet.fingerprint:
            return True
        self._differing[system] = now
        return False

    def begun(self, now: int, system: int, statement: Statement) -> bool:
        """Return whether a sender whose clock is right can have sent ``statement`` by ``now`` (µs)."""
        return self._begun(now, system, max(statement.epoch, statement.since))

    def _begun(self, now: int, system: int, epoch: int) -> bool:
        if epoch - now <= _AHEAD * self._config.epoch_us:
            return True
        self._early[system] = now
        return False

    def differs(self, now: int, system: int) -> bool:
        """Return whether ``system`` has lately sent a statement of another fleet, at ``now`` (µs)."""
        return system in _recent(self._differing, now)

    def refused_senders(self, now: int, doubted: Iterable[int]) -> RefusedSenders:
        """Return the senders whose plans are refused at ``now`` (µs); two vehicles have a ``doubted`` id."""
        foreign = _recent(self._foreign, now)
        differing = (_recent(self._differing, now) | _recent(self._other_knots, now)) - foreign
        doubled = set(doubted) - foreign - differing
        early = _recent(self._early, now)
        return RefusedSenders(*(tuple(sorted(found)) for found in (doubled, foreign, differing, early)))


def _recent(times: dict[int, int], now: int) -> set[int]:
    """Return the systems whose time is less than ``_REPORTED_US`` before ``now`` (µs)."""
    return {system for system, time in times.items() if now - time < _REPORTED_US}
