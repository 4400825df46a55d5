"""Protocol of collision avoidance, which the field and the committed plans implement."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol

from companion.avoidance.field.plan_log import PlanLog
from companion.avoidance.field.planner import Aim
from companion.config.planning import MethodName
from companion.estimation.fusion_log import FusionTally
from companion.flight.guard import Holding
from companion.flight.lowering import Lowered
from companion.flight.tracking import Tracking
from companion.values.horizon import Array, Horizon, Motion
from companion.values.refused_senders import RefusedSenders
from companion.values.stance import Stance
from companion.world import View
from mavlink_bridge.messages import Message


class Tally(NamedTuple):
    """Counters of one companion so far.

    ``plans`` that were made, and how many of them with ``relaxed`` bounds; ``solver_failures``; ``held``: how
    often an old plan was kept; ``anchored_anew``: how often planning restarted at the measured position.
    ``left_tube``: how often the vehicle left the tube of its committed plan.
    ``plan_ns``: stopwatch reading (ns) of each attempt to plan, clipped to 4.29 s. ``plan_at``: time (µs on
    the companion's clock) of the step that made the attempt. ``fusion``: of detections.
    """

    plans: int
    relaxed: int
    solver_failures: int
    held: int
    anchored_anew: int
    plan_ns: Sequence[int]
    plan_at: Sequence[int] = ()
    fusion: FusionTally = FusionTally()
    left_tube: int = 0


class AvoidanceInputs(NamedTuple):
    """Inputs of one step of avoidance.

    ``measured``: the own motion, its velocity clipped to the limits; ``stale``: whether it is too old to plan
    from; ``aim``: function that returns the aim of a plan made now, None if a user's surface fails. Call it
    once in a step at most, because it may end a phase of the flight.
    """

    view: View
    measured: Motion
    stale: bool
    aim: Callable[[], Aim | None]


class Avoidance(Protocol):
    """Collision avoidance of one vehicle: makes the horizon that it flies."""

    next_due: int
    """Time (µs) at which the next plan is due; with committed plans, the next yaw."""

    @property
    def lookahead_s(self) -> float:
        """Upper bound (s) of the time from now to the end of the next plan."""
        ...

    @property
    def horizon(self) -> Horizon | None:
        """Horizon that is flown; None while set-points do not steer the vehicle."""
        ...

    @property
    def state(self) -> Holding:
        """Kind of the horizon that is flown."""
        ...

    @property
    def failing(self) -> int | None:
        """Time (µs) at which the solver began to fail; None if its last attempt succeeded."""
        ...

    @property
    def enclosed(self) -> bool:
        """Whether fixed obstacles leave no way to the destination, as far as avoidance has ways."""
        ...

    @property
    def tracking(self) -> Tracking:
        """Tracking of the set-points by the vehicle."""
        ...

    @property
    def held(self) -> int:
        """Number of times that an old plan was kept."""
        ...

    @property
    def tally(self) -> Tally:
        """Counters for the summary."""
        ...

    @property
    def log(self) -> PlanLog:
        """Log of the field's plans since the last ``shed``."""
        ...

    def refused(self, now: int) -> RefusedSenders:
        """Return the senders whose plans are refused at ``now`` (µs)."""
        ...

    def shed(self) -> None:
        """Empty the log."""
        ...

    def use(self, methods: tuple[MethodName, ...]) -> None:
        """Use ``methods`` of the field from the next plan on."""
        ...

    def keep(self, lowered: Lowered) -> None:
        """Stay within ``lowered``, the limits that the autopilot can follow, from the next plan on."""
        ...

    def begin(self, now: int, measured: Motion) -> None:
        """Start to steer at ``now`` (µs) from the ``measured`` motion."""
        ...

    def pause(self, gap: int) -> None:
        """React to a pause of ``gap`` (µs) since the last step: a long one may end the flown horizon."""
        ...

    def discard(self) -> None:
        """Discard the horizon that is flown."""
        ...

    def rest(self, now: int, velocity: Array | None) -> None:
        """Discard the horizon and the state of tracking while set-points do not control the vehicle.

        ``velocity`` (3,), m/s: the measured one at ``now`` (µs), or None.
        """
        ...

    def park(self, now: int, measured: Motion, stance: Stance) -> None:
        """Reserve the place of a vehicle that set-points do not steer, with its ``measured`` motion."""
        ...

    def wait(self, now: int) -> str:
        """Return what the autopilot must wait for before it takes off or lands; an empty string: nothing."""
        ...

    @property
    def parked(self) -> bool:
        """Whether the vehicle stands on the ground and takes no part."""
        ...

    def fly(self, now: int, situation: AvoidanceInputs) -> Array | None:
        """Update the horizon at ``now`` (µs).

        Returns the own positions (N + 1, 3), m, of the next steps if a new yaw plan is due along them,
        otherwise None.
        """
        ...

    def finish(self) -> None:
        """Make no further plan."""
        ...

    def rests(self, now: int) -> bool:
        """Return whether nothing is flown, or the committed plan is at rest at ``now`` (µs)."""
        ...

    def idle(self, now: int) -> bool:
        """Return whether nothing is to be planned or sent at ``now`` (µs)."""
        ...

    def receive(self, now: int, link: str, message: Message) -> bool:
        """Receive ``message`` from ``link``; return False for a message that avoidance does not use."""
        ...

    def messages(self, now: int, *, farewell: bool) -> list[Message]:
        """Return the messages for the swarm link; ``farewell``: the vehicle makes no further plan."""
        ...

    def recall(self) -> bool:
        """Recall what the last ``messages`` announced, which are not sent; return False if that cannot be."""
        ...

    def shared(self, now: int, view: View) -> Horizon | None:
        """Return the horizon to share with the neighbours in plan messages; None for no such message."""
        ...
