"""Check of set-points against the limits, one at a time, in constant memory.

The statistics are those of ``outrider.shadow.setpoints``.
"""

from __future__ import annotations

from collections import Counter
from math import dist, hypot, inf, isfinite, pi

from pymavlink.dialects.v20 import all as mavlink

from companion.config.planning import HeadingConfig, LimitsConfig
from companion.flight.setpoint import is_finite
from mavlink_bridge.messages import SetpointLocal, Vector

TOGETHER = 100_000
"""Longest interval that counts as a step (µs); a longer one is a gap."""
_MAX_YAW_INTERVAL_US = 35_000
"""Longest interval over which yaw is compared (µs). After a longer pause yaw restarts at the heading."""


class SetpointCheck:
    """Running statistics of set-points, fed with each set-point and its time (µs).

    Limits: speed ``fastest`` (m/s), acceleration ``hardest`` (m/s²), yaw rate ``turning`` (rad/s). A step of
    position or yaw between two set-points may exceed limit × interval only by a tolerance.
    """

    def __init__(self, fastest: float, hardest: float, turning: float = inf) -> None:
        self.count = self.gaps = 0
        self.finite = True
        self.step = self.speed = self.acceleration = self.jump = self.swing = self.spin = 0.0
        self._fastest, self._hardest, self._turning = fastest, hardest, turning
        self.masks: Counter[int] = Counter()
        self.frames: Counter[int] = Counter()
        self._last: tuple[int, Vector, float] | None = None

    def take(self, now: int, message: SetpointLocal) -> None:
        """Add a set-point that is sent, or in a dry run would be sent, at ``now`` (µs)."""
        self.count += 1
        self.masks[message.type_mask] += 1
        self.frames[message.frame] += 1
        if not is_finite(message):
            self.finite = False
            return
        self.speed = max(self.speed, hypot(*message.velocity))
        self.acceleration = max(self.acceleration, hypot(*message.acceleration))
        if self._last is not None:
            before, place, yaw = self._last
            if now - before > TOGETHER:
                self.gaps += 1
            else:
                step = dist(place, message.position)
                self.step = max(self.step, step)
                self.jump = max(self.jump, step - self._fastest * (now - before) * 1e-6)
                if now - before <= _MAX_YAW_INTERVAL_US:
                    swing = abs((message.yaw - yaw + pi) % (2.0 * pi) - pi)
                    self.swing = max(self.swing, swing - self._turning * (now - before) * 1e-6)
        self.spin = max(self.spin, abs(message.yaw_rate))
        self._last = now, message.position, message.yaw

    @property
    def facts(self) -> dict[str, object]:
        """Statistics for the summary; a maximum that is not finite is None."""
        largest = {
            "max_step_m": self.step,
            "max_speed_m_s": self.speed,
            "max_acceleration_m_s2": self.acceleration,
        }
        return {
            "count": self.count,
            "finite": self.finite,
            **{name: round(value, 4) if isfinite(value) else None for name, value in largest.items()},
            "gaps": self.gaps,
            "mask_counts": {f"0x{mask:03X}": n for mask, n in sorted(self.masks.items())},
            "frames": {str(frame): n for frame, n in sorted(self.frames.items())},
        }

    def faults(self, mask: int) -> list[str]:
        """Return the faults as text; the autopilot expects type mask ``mask``."""
        wrong = {
            "not all are finite": not self.finite,
            f"type masks other than 0x{mask:03X}": bool(set(self.masks) - {mask}),
            f"frames other than {mavlink.MAV_FRAME_LOCAL_NED}": bool(
                set(self.frames) - {mavlink.MAV_FRAME_LOCAL_NED}
            ),
            f"faster than {self._fastest:.1f} m/s": self.speed > self._fastest + _ROUNDING,
            f"more than {self._hardest:.1f} m/s²": self.acceleration > self._hardest + _ROUNDING,
            f"a jump of {self.jump:.2f} m": self.jump > _POSITION_STEP_TOLERANCE_M,
            f"a jump of {self.swing:.2f} rad": self.swing > _YAW_STEP_TOLERANCE_RAD,
            f"turning faster than {self._turning:.1f} rad/s": self.spin > self._turning + _ROUNDING,
        }
        return [what for what, is_so in wrong.items() if is_so]


def setpoint_check(
    limits: LimitsConfig, heading: HeadingConfig | None = None, compensation: float = 0.0
) -> SetpointCheck:
    """Return a check for a companion with these limits.

    ``compensation`` (m/s²): maximum addition to the plan's acceleration. Without ``heading`` the yaw is not
    checked, because it jumps when a flight continues after a pilot has turned the vehicle.
    """
    return SetpointCheck(
        hypot(*limits.fastest), limits.a_total + compensation, inf if heading is None else heading.rate_max
    )


_ROUNDING = 1e-3
_YAW_STEP_TOLERANCE_RAD = 0.02
"""Tolerance of yaw steps (rad): a shadow run's clock may run 1 % faster or slower than the log's clock."""
_POSITION_STEP_TOLERANCE_M = 0.15
"""Tolerance of position steps (m): correction of the own position estimate between two set-points."""
