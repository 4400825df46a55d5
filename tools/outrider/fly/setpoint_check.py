"""Check of a sequence of set-points against the limits, one at a time and in little memory.

The figures are those of ``outrider.shadow.setpoints``.
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
_IN_A_ROW = 35_000
"""Longest interval over which yaw is compared (µs). After any pause yaw restarts at the vehicle's heading."""


class SetpointCheck:
    """Running statistics of set-points, fed with each set-point and its time (µs).

    No set-point may be faster than ``fastest`` (m/s), accelerate harder than ``hardest`` (m/s²), turn faster
    than ``turning`` (rad/s), or jump further than these limits explain.
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
        """Add a set-point that is sent, or would be sent, at ``now`` (µs)."""
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
                if now - before <= _IN_A_ROW:
                    swing = abs((message.yaw - yaw + pi) % (2.0 * pi) - pi)
                    self.swing = max(self.swing, swing - self._turning * (now - before) * 1e-6)
        self.spin = max(self.spin, abs(message.yaw_rate))
        self._last = now, message.position, message.yaw

    @property
    def facts(self) -> dict[str, object]:
        """Statistics for the summary."""
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
        """Return what is wrong with the set-points for an autopilot that expects type mask ``mask``."""
        wrong = {
            "not all are finite": not self.finite,
            f"type masks other than 0x{mask:03X}": bool(set(self.masks) - {mask}),
            f"frames other than {mavlink.MAV_FRAME_LOCAL_NED}": bool(
                set(self.frames) - {mavlink.MAV_FRAME_LOCAL_NED}
            ),
            f"faster than {self._fastest:.1f} m/s": self.speed > self._fastest + _ROUNDED,
            f"more than {self._hardest:.1f} m/s²": self.acceleration > self._hardest + _ROUNDED,
            f"a jump of {self.jump:.2f} m": self.jump > _CORRECTED,
            f"a jump of {self.swing:.2f} rad": self.swing > _TURNED,
            f"turning faster than {self._turning:.1f} rad/s": self.spin > self._turning + _ROUNDED,
        }
        return [what for what, is_so in wrong.items() if is_so]


def gauge_for(
    limits: LimitsConfig, heading: HeadingConfig | None = None, compensation: float = 0.0
) -> SetpointCheck:
    """Return a check for a companion with these limits.

    ``compensation`` (m/s²) may be added to the plan's acceleration. Without ``heading`` the yaw is not
    checked, as it jumps where a flight continues after a pilot has turned the vehicle.
    """
    return SetpointCheck(
        hypot(*limits.v_max), limits.a_total + compensation, inf if heading is None else heading.rate_max
    )


_ROUNDED = 1e-3
_TURNED = 0.02
"""Tolerance of yaw steps (rad): the own clock may run one hundredth faster or slower than the log's."""
_CORRECTED = 0.15
"""Tolerance of position steps (m): correction of the own position estimate between two set-points."""
