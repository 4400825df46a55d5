"""Stream of set-points from the horizon that is flown."""

from __future__ import annotations

from companion.config import CompanionConfig
from companion.flight.setpoint import is_finite, setpoint
from companion.flight.state_machine import Pilot
from companion.planning.avoidance import Avoidance
from companion.planning.planning import Planning
from companion.world import View
from mavlink_bridge.messages import Message, Source


class Setpoints:
    """Set-points for the autopilot of ``own``, one every ``rates.setpoint_us``."""

    def __init__(
        self, config: CompanionConfig, own: Source, pilot: Pilot, avoidance: Avoidance, planning: Planning
    ) -> None:
        self._config, self._own, self._pilot = config, own, pilot
        self._avoidance, self._planning = avoidance, planning
        self._boot = 0
        self.next_due = 0
        """Time (µs) at which the next set-point is due."""
        self.not_finite = 0
        """Number of set-points that were not finite and therefore not sent."""

    def start(self, now: int) -> None:
        """Start the stream; ``now`` (µs) becomes the zero of the set-points' time since boot."""
        self._boot = self.next_due = now

    def due(self, now: int, view: View) -> list[Message]:
        """Return the set-point if one is due at ``now`` (µs), otherwise an empty list.

        No set-point is sent without a horizon, a known autopilot or a local frame, while ``pilot.streaming``
        is false, or if it is not finite.
        """
        if now < self.next_due:
            return []
        period = self._config.rates.setpoint_us
        self.next_due += period * (1 + (now - self.next_due) // period)
        horizon, profile = self._avoidance.horizon, self._pilot.vehicle.profile
        if not self._pilot.streaming or horizon is None or profile is None or view.local is None:
            return []
        time, tracking = now + self._config.setpoint_lead_us, self._avoidance.tracking
        message = setpoint(
            time,
            now - self._boot,
            horizon,
            self._planning.yaw(time),
            view.local,
            self._own,
            profile.setpoint_mask,
            tracking.added_acceleration,
            tracking.bias,
            self._planning.velocities,
            tracking.lead(self._pilot.limits.loop),
            tracking.added_velocity,
        )
        if not is_finite(message):
            # The horizon is discarded, so planning restarts at the measured position.
            self.not_finite += 1
            self._avoidance.discard()
            return []
        self._pilot.streamed(now)
        return [message]
