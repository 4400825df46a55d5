"""Flight of a scenario in a test, and replay of a log, with assertions."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import Heartbeat
from mavlink_bridge.tlog.log import read_tlog
from mavlink_bridge.wire.codec import Codec
from outrider.logs.flight_modes import mode_of
from outrider.replay.run_replay import again
from outrider.replay.target_replay import setpoints
from outrider.runs import names
from outrider.runs.summary import Value
from outrider.shadow.shadow_run import ShadowRun
from outrider.testing.golden import Golden
from outrider.testing.setpoints import Setpoints


class Transition(NamedTuple):
    """Change of an autopilot's mode: from ``time`` (µs) on it is in ``mode``."""

    time: int
    mode: str


class Flown:
    """Finished flight: its ``summary``, and its files in ``directory``."""

    def __init__(
        self, directory: Path, summary: dict[str, Value], systems: Sequence[int], golden: Golden
    ) -> None:
        self.directory, self.summary, self.systems = directory, summary, tuple(systems)
        self._golden = golden

    def setpoints(self, system: int | None = None) -> Setpoints:
        """Return the set-points that a companion sent to a vehicle, by default the first."""
        system = self.systems[0] if system is None else system
        return Setpoints(f"vehicle {system}", setpoints(self.log(system)), self._golden)

    def log(self, system: int) -> Path:
        """Return the path of a vehicle's tlog. Raises AssertionError for an unknown id."""
        if system not in self.systems:
            raise AssertionError(
                f"there is no vehicle {system}; there are {', '.join(map(str, self.systems))}"
            )
        return self.directory / names.log(system)

    def modes(self, system: int | None = None) -> list[Transition]:
        """Return the modes of a vehicle's autopilot in order, from its HEARTBEATs."""
        return modes(self.log(self.systems[0] if system is None else system), system or self.systems[0])

    def assert_separation(self, at_least: float) -> None:
        """Assert that no two vehicles came nearer than ``at_least`` and that no d_min was violated.

        ``at_least`` is in m between centres, on true positions.
        """
        __tracebackhide__ = True
        least, violations = self.summary["min_separation_m"], self.summary["d_min_violations"]
        if not isinstance(least, float):
            raise AssertionError("there are no two vehicles in the air")
        if least < at_least:
            raise AssertionError(f"two vehicles came to {least:.3f} m; at least {at_least:g} m are asked for")
        if violations:
            raise AssertionError(f"{violations} violations of d_min")

    def assert_converged(self, within: float) -> None:
        """Assert that every vehicle was at its goal within ``within`` s of the goal event."""
        __tracebackhide__ = True
        seconds = self.summary["convergence_time_s"]
        if not isinstance(seconds, float):
            raise AssertionError(
                "not converged" if self.summary["converged"] is False else "there is no goal"
            )
        if seconds > within:
            raise AssertionError(f"converged after {seconds:g} s; {within:g} s are allowed")

    def assert_standoff(self, p95: float) -> None:
        """Assert that 95 % of the distances from the destination surface are within ``p95`` m."""
        __tracebackhide__ = True
        found = self.summary["standoff_error_m"]
        value = found["p95"] if isinstance(found, dict) else None
        if value is None:
            raise AssertionError("there is no surface to be on: this scenario has goals")
        if value > p95:
            raise AssertionError(f"the stand-off error is {value:g} m at p95; {p95:g} m are allowed")

    def assert_modes(self, *expected: str, system: int | None = None) -> None:
        """Assert that the autopilot had exactly these modes, in this order."""
        __tracebackhide__ = True
        found = [transition.mode for transition in self.modes(system)]
        if found != list(expected):
            raise AssertionError(f"the modes were {' → '.join(found)}, not {' → '.join(expected)}")

    def assert_reenacts(self) -> None:
        """Assert that every companion sends the same bytes again when re-run from its log."""
        __tracebackhide__ = True
        for one in again(self.directory):
            if not one.identical:
                raise AssertionError(
                    f"vehicle {one.system}: {one.different} frames differ, first {one.first}"
                )


class Replayed(Setpoints):
    """Set-points that a companion would have sent to a log's vehicle.

    ``sent``: those that were sent to it; ``reasons``: number of 10 ms steps without a set-point, by the
    missing input; ``holds``: how often the companion kept an old plan.
    """

    def __init__(self, name: str, found: ShadowRun, golden: Golden) -> None:
        super().__init__(name, found.would, golden)
        self.sent = Setpoints(f"{name}, as it was sent", found.sent, golden)
        self.reasons = dict(found.reasons)
        self.holds = found.holds


def modes(log: Path, system: int) -> list[Transition]:
    """Return the modes of the autopilot of ``system``, from its HEARTBEATs in ``log``."""
    beat = mavlink.MAVLINK_MSG_ID_HEARTBEAT, system, mavlink.MAV_COMP_ID_AUTOPILOT1
    codec = Codec(lambda identifier, sender, component: (identifier, sender, component) == beat)
    found: list[Transition] = []
    for record in read_tlog(log):
        for message in codec.feed(record.frame):
            if isinstance(message, Heartbeat):
                name = mode_of(message)
                if not found or found[-1].mode != name:
                    found.append(Transition(record.time, name))
    return found
