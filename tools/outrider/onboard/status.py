"""Status of the flying process: each change when it happens, and the state five times a second."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from companion.dry_run import DryRun
from companion.flight.health_monitor import Concern
from companion.flight.landing import Landing
from companion.flight.readiness import OPERATORS_GO
from companion.flight.vehicle import Vehicle
from companion.values.phase import Phase
from mavlink_bridge.clocks.followed_clock import FollowedClock
from mavlink_bridge.frames import ned_to_enu
from mavlink_bridge.loops.histogram import Histogram
from mavlink_bridge.messages import SetpointLocal
from mavlink_bridge.wire.signing import Signing
from outrider.logs.flight_modes import mode_of
from outrider.onboard.transmit_statistics import TransmitStatistics
from outrider.supervision.supervised_node import DUPLICATE, OURS, SupervisedNode

SHOWN = 200_000
"""Wall time between two states (µs)."""
_STATES_PER_UPDATE = 5
"""Number of states between two updates of figures that take longer to compute."""
_REPEAT_AFTER_S = 10.0
"""Time (s) after which a repeated status text of the autopilot, or a repeated refusal, is reported again."""
_REPEATED = ("autopilot", "refused")
_WAITING = (Phase.CONNECT, Phase.PREPARE)
_QUARTZ_RATE_TOLERANCE = 0.005
"""Error |rate − 1| from which on a clock is not a quartz clock."""


class State(NamedTuple):
    """State of the flight.

    ``at``: the companion's time since its start (s). ``position``, ``velocity``: fleet-local ENU (m, m/s).
    ``*_ms``: ages (ms), but ``plan_ms``: median and 99th percentile of CPU time per plan. ``beat``: the
    autopilot's last heartbeat: type, autopilot, base and custom mode, system status. ``stamp``: time stamp of
    the newest signature. ``would``: in a dry run, the last set-point that would have been sent.
    ``simulated``: whether the autopilot's clock is a simulation's, None before this is known.
    """

    at: float = 0.0
    phase: str = Phase.CONNECT.value
    waiting: str = ""
    mode: str = ""
    armed: bool = False
    guided: bool = False
    beat: tuple[int, int, int, int, int] | None = None
    position: tuple[float, float, float] | None = None
    velocity: tuple[float, float, float] | None = None
    own_ms: int | None = None
    target_ms: int | None = None
    neighbours_ms: dict[str, int] = {}  # noqa: RUF012
    plans: int = 0
    held: int = 0
    failures: int = 0
    plan_ms: tuple[float, float] = (0.0, 0.0)
    rate: float = 1.0
    clock_steps: int = 0
    setpoints: int = 0
    would: str = ""
    concerns: tuple[str, ...] = ()
    stamp: int = 0
    simulated: bool | None = None

    @property
    def ours(self) -> bool:
        """Whether the companion is in control of the vehicle."""
        return Phase(self.phase) in OURS


class StatusReports:
    """Status reporter: ``look`` is called after every step and reports through ``tell``."""

    def __init__(
        self,
        supervised: SupervisedNode,
        departures: TransmitStatistics,
        followed: FollowedClock | None,
        signing: Signing | None,
        tell: Callable[..., None],
    ) -> None:
        self._supervised, self._companion, self._departures = supervised, supervised.companion, departures
        self._followed, self._signing = followed, signing
        self._tell = tell
        self.plan_times = Histogram()
        """CPU time per plan (µs)."""
        self._began: int | None = None
        self._shown: int | None = None
        self._phase: Phase | None = None
        self._states = 0
        self._plan_ms = (0.0, 0.0)
        self._reported = self._refused = self._steps = self._remarked = 0
        self._judged = self._duplicates = False
        self._landing: Landing | None = None
        self._concerns: dict[str, Concern] = {}
        self._sentences: dict[str, str] = {}
        self._lately: dict[tuple[str, str], float] = {}

    def look(self, now: int, wall: int) -> None:
        """Report changes, and the state when it is due, after the step at ``now`` (µs, own clock).

        ``wall`` is the wall time (µs).
        """
        self._began = now if self._began is None else self._began
        at = round((now - self._began) * 1e-6, 2)
        phase = self._companion.pilot.phase
        # At a change of phase the parent needs the whole state at once: it may send the hold request soon.
        at_once = phase is not self._phase
        self._changes(at)
        if self._shown is None or at_once or wall - self._shown >= SHOWN:
            self._shown, self._phase = wall, phase
            self._tell(kind="state", **self.state(now)._asdict())

    def state(self, now: int) -> State:
        """Return the state at ``now`` (µs)."""
        node, pilot = self._companion, self._companion.pilot
        vehicle, view = pilot.vehicle, node.world.at(now)
        if self._states % _STATES_PER_UPDATE == 0:
            for reading in node.shed():
                self.plan_times.add(reading // 1000)
            spread = self.plan_times.spread
            self._plan_ms = (round(spread.p50 * 1e-3, 2), round(spread.p99 * 1e-3, 2))
        self._states += 1
        tally, beat, own = node.tally, vehicle.heartbeat, view.own
        ages = node.world.neighbours.ages(now)
        east, north, up = (0.0, 0.0, 0.0) if own is None else own.position.tolist()
        u, v, w = (0.0, 0.0, 0.0) if own is None else own.velocity.tolist()
        return State(
            round((now - (self._began or now)) * 1e-6, 2),
            pilot.phase.value,
            self._waiting(),
            _mode(vehicle),
            vehicle.armed,
            vehicle.guided,
            None if beat is None else _numbers(vehicle),
            None if own is None else (round(east, 2), round(north, 2), round(up, 2)),
            None if own is None else (round(u, 2), round(v, 2), round(w, 2)),
            None if own is None else own.age // 1000,
            None if view.target is None else view.target.age // 1000,
            {str(system): age // 1000 for system, age in sorted(ages.items())},
            tally.plans,
            tally.held,
            tally.solver_failures,
            self._plan_ms,
            1.0 if self._followed is None else round(self._followed.rate, 3),
            0 if self._followed is None else self._followed.steps,
            self._departures.setpoints.count,
            self._would(),
            tuple(concern.text for concern in node.health.concerns.values()),
            0 if self._signing is None else self._signing.newest,
            None if self._followed is None else self._followed.verdict,
        )

    def _changes(self, at: float) -> None:
        node, pilot = self._companion, self._companion.pilot
        vehicle = pilot.vehicle
        if pilot.landing is not self._landing:
            self._landing = pilot.landing
            if self._landing is not None:
                # Before the phase: the receiver needs the landing when it receives the final phase.
                self._tell(kind="landing", **self._landing._asdict())
        sentences = {
            "phase": pilot.phase.value,
            "waiting": self._waiting(),
            "mode": _mode(vehicle),
            "armed": ("armed" if vehicle.armed else "disarmed") if vehicle.heartbeat is not None else "",
        }
        if sentences != self._sentences:
            for what, sentence in sentences.items():
                if sentence and sentence != self._sentences.get(what):
                    self._event(at, what, sentence)
            self._sentences = sentences
        if vehicle.reported != self._reported:
            new = min(vehicle.reported - self._reported, len(vehicle.texts))
            for text in list(vehicle.texts)[len(vehicle.texts) - new :]:
                self._event(at, "autopilot", text.text)
            self._reported = vehicle.reported
        if pilot.limits.said != self._remarked:
            new = min(pilot.limits.said - self._remarked, len(pilot.limits.remarks))
            for remark in list(pilot.limits.remarks)[len(pilot.limits.remarks) - new :]:
                self._event(at, "limits", remark)
            self._remarked = pilot.limits.said
        commands = pilot.commands
        if commands.refused != self._refused:
            for refusal in list(commands.refusals)[-(commands.refused - self._refused) :]:
                self._event(at, "refused", refusal)
            self._refused = commands.refused
        concerns = node.health.concerns
        if concerns is not self._concerns:
            for name, concern in concerns.items():
                if name not in self._concerns:
                    self._event(at, "concern", concern.text)
            for name, concern in self._concerns.items():
                if name not in concerns:
                    self._event(at, "over", concern.text)
            self._concerns = concerns
        if (duplicates := self._supervised.barred == DUPLICATE) != self._duplicates:
            self._duplicates = duplicates
            self._event(
                at, "critical" if duplicates else "over", "another companion with this system id is heard"
            )
        if self._followed is not None and self._followed.steps != self._steps:
            self._steps = self._followed.steps
            self._event(at, "clock", "the autopilot's clock was set, or began anew")
        if self._followed is not None and self._followed.judged is not None and not self._judged:
            self._judged = True
            self._event(at, "clock", judgement(self._followed.judged, simulated=self._followed.simulated))

    def _waiting(self) -> str:
        pilot = self._companion.pilot
        if isinstance(self._companion, DryRun):
            return self._companion.pilot.lacking
        if pilot.phase is Phase.CONNECT and pilot.waiting_for == OPERATORS_GO and self._supervised.barred:
            return self._supervised.barred
        return pilot.waiting_for if pilot.phase in _WAITING else ""

    def _would(self) -> str:
        """Return the last set-point of a dry run as text; empty otherwise."""
        newest = self._departures.newest
        return _words(newest) if isinstance(self._companion, DryRun) and newest is not None else ""

    def _event(self, at: float, what: str, text: str) -> None:
        if self._lately.get((what, text), -_REPEAT_AFTER_S) + _REPEAT_AFTER_S > at and what in _REPEATED:
            return
        self._lately = {key: time for key, time in self._lately.items() if time + _REPEAT_AFTER_S > at}
        self._lately[what, text] = at
        self._tell(kind="event", at=at, what=what, text=text)


def judgement(rate: float, *, simulated: bool) -> str:
    """Return as text what the autopilot's clock was found to be."""
    if simulated:
        return f"a simulation's, {rate:.3f} times as fast as the wall's: it is followed"
    if abs(rate - 1.0) < _QUARTZ_RATE_TOLERANCE:
        return "a real one: the wall's time counts"
    return (
        f"taken for a real one with a delay that changes, though it seems to be {rate:.3f} times as fast; "
        "for a simulation write clock: autopilot"
    )


def _words(message: SetpointLocal) -> str:
    place, speed = ned_to_enu(message.position).tolist(), ned_to_enu(message.velocity).tolist()
    where = ", ".join(f"{part:.1f}" for part in place)
    how = ", ".join(f"{part:.1f}" for part in speed)
    return f"east, north, up {where} m of the vehicle's origin, {how} m/s, mask 0x{message.type_mask:03X}"


def _mode(vehicle: Vehicle) -> str:
    """Return the name of the autopilot's mode, empty before the first heartbeat."""
    return "" if vehicle.heartbeat is None or vehicle.profile is None else mode_of(vehicle.heartbeat)


def _numbers(vehicle: Vehicle) -> tuple[int, int, int, int, int]:
    beat = vehicle.heartbeat
    if beat is None:
        return (0, 0, 0, 0, 0)
    return beat.type, beat.autopilot, beat.base_mode, beat.custom_mode, beat.system_status
