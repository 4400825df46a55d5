"""Battery and fence failsafes, and the checks before arming."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from mavlink_bridge.messages import FenceStatus, Source
from sitl.autopilot.commander import Commander
from sitl.autopilot.fences import Breach, Fences
from sitl.autopilot.firmware import ACTIONS, BatteryCondition, Firmware
from sitl.estimation.sensors import Estimate
from sitl.telemetry.status_text import StatusReporter
from sitl.vehicle.battery import Battery, Charge

_PERIOD_US: Final = 100_000
# µs between two reports of the objections to arming; ArduPilot repeats them.
_REPEAT_US: Final = 30_000_000
_WORDS: Final = {
    Breach.TOO_LOW: "too low",
    Breach.TOO_HIGH: "too high",
    Breach.BOUNDARY: "outside",
}


class Failsafes:
    """Monitor of battery and fence. Call ``watch`` when ``next_due`` (µs) has come."""

    def __init__(
        self,
        flavour: Firmware,
        commander: Commander,
        fences: Fences,
        battery: Battery | None,
        estimate: Callable[[], Estimate],
        status_text: StatusReporter,
    ) -> None:
        self._flavour = flavour
        self._commander = commander
        self._fences = fences
        self._battery = battery
        self._estimate = estimate
        self._status_text = status_text
        self._battery_condition = BatteryCondition(0)
        self._worse_since: int | None = None
        self._breach = Breach.NONE
        self._breached_at = 0
        self._breaches = 0
        self._reported_at = 0
        self.next_due = 0

    @property
    def breached(self) -> bool:
        """Whether the vehicle was beyond its fence at the last check."""
        return self._breach is not Breach.NONE

    def fence_status(self, source: Source) -> FenceStatus:
        """Return FENCE_STATUS (162)."""
        return FenceStatus(
            source, self._breached_at, self.breached, self._breaches & 0xFFFF, int(self._breach)
        )

    def doubts(self) -> list[str]:
        """Return the objections to arming, except those that depend on the mode."""
        found = [] if self._commander.ready else ["no position yet"]
        if self._battery is not None and self._battery.charge.remaining <= 0.0:
            found.append("battery empty")
        elif self._battery_condition.level:
            found.append(f"battery {self._battery_condition.word}")
        if self._commander.ready and self._where() is not Breach.NONE:
            found.append(f"{_WORDS[self._where()]} of the fence")
        return found

    def watch(self, now: int) -> None:
        """Check battery and fence at ``now`` (µs)."""
        self.next_due = now + _PERIOD_US
        if self._battery is not None:
            self._watch_battery(self._battery.charge, now)
        commander = self._commander
        if commander.armed and commander.ready:
            self._watch_fence(now)
        elif not commander.armed:
            self._breach = Breach.NONE
        if not commander.armed and self._flavour.repeats_doubts and now - self._reported_at >= _REPEAT_US:
            self._reported_at = now
            self.say_doubts(now)

    def say_doubts(self, now: int) -> None:
        """Send one text per objection to arming at ``now`` (µs)."""
        of_mode = self._commander.mode_doubt(now)
        for doubt in [*([of_mode] if of_mode else []), *self.doubts()]:
            self._status_text.warn(f"{self._flavour.doubt_prefix}{doubt}")

    # Internals

    def _watch_battery(self, charge: Charge, now: int) -> None:
        commander = self._commander
        if charge.remaining <= 0.0 and commander.armed:
            commander.cut("Battery empty: motors stopped")
        condition = self._flavour.battery_condition(charge)
        if not commander.armed and condition.level < self._battery_condition.level:
            self._battery_condition = condition
        if condition.level <= self._battery_condition.level:
            self._worse_since = None
            return
        if self._worse_since is None:
            self._worse_since = now
        if now - self._worse_since >= self._flavour.battery_timeout_us:
            self._battery_condition, self._worse_since = condition, None
            self._status_text.warn(
                f"Battery {condition.word}: {charge.voltage:.1f} V, {100 * charge.remaining:.0f} %"
            )
            if condition.mode is not None:
                commander.fail_safe(condition.mode, now)

    def _where(self) -> Breach:
        rules = self._flavour.fence_rules
        limited = self._fences.uploaded or min(rules.height, rules.radius, -rules.floor) < math.inf
        if not (rules.enabled and limited):
            return Breach.NONE
        return self._fences.breach(self._estimate().position, rules)

    def _watch_fence(self, now: int) -> None:
        breach, before = self._where(), self._breach
        self._breach = breach
        if breach is before or breach is Breach.NONE:
            return
        self._breaches += 1
        self._breached_at = now
        action = self._flavour.fence_rules.action
        if action == "nothing":
            return
        self._status_text.warn(f"Fence breached: {_WORDS[breach]}")
        if action == "terminate":
            self._commander.cut("Flight terminated")
        elif (mode := ACTIONS[action]) is not None:
            self._commander.fail_safe(mode, now)
