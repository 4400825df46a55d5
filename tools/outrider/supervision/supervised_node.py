"""Companion under supervision: its clock may follow the autopilot's, and a hold on exit can replace it.

Until the rate of a followed clock is known, nothing is received from or sent to the swarm and the target,
because the ages of their messages are computed on the companion's clock, and no order to take off is
accepted. No such order is accepted either while another sender has the companion's ids; then a pending order
to take off is withdrawn.
"""

from __future__ import annotations

from collections.abc import Sequence

from companion.dry_run import DryRun
from companion.estimation.time_sync import Answer
from companion.flight.hold_on_exit import HoldOnExit
from companion.node import Companion
from companion.telemetry.status_text import Severity
from companion.values.phase import STEERED, Phase
from mavlink_bridge.clocks.clock import Clock
from mavlink_bridge.clocks.followed_clock import FollowedClock
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.signing import Signing
from outrider.supervision.duplicate_ids import DuplicateIds
from outrider.supervision.takeoff_inhibit import TakeoffInhibit

CLOCK = "the rate of the autopilot's clock"
DUPLICATE = "the other companion with this system id to fall silent"
"""``CLOCK`` and ``DUPLICATE``: conditions for which any order to take off has to wait, as text."""
BEHIND = "Own id: twin's clock behind, or replay"
"""Text about signed frames with the own ids and old stamps: those of a duplicate, or recordings."""
OURS = (Phase.PREPARE, *STEERED, Phase.LAND)
"""Phases in which the companion controls the vehicle.

In all other phases, as when another controller has taken over the vehicle, no hold is requested on exit.
"""
SETTLING_US = 1_000_000
"""Time for which a committed plan has been at rest before the hold is requested (µs).

The vehicle follows its plan late.
"""
_MAX_OPEN_REQUESTS = 32
"""Number of TIMESYNC requests whose answers may still count."""
_OTHERS = ("swarm", "target")


class SupervisedNode:
    """``Node`` that supervises a companion.

    ``followed``: clock that receives the autopilot's time stamps that the companion accepts; None for a
    companion on wall time. ``signing``: the companion's. ``duplicates``: detector of duplicates on its links;
    unused in a dry run, whose component id differs from that of a companion that may be present as well.
    """

    def __init__(
        self,
        companion: Companion,
        wall: Clock,
        followed: FollowedClock | None,
        signing: Signing | None,
        duplicates: DuplicateIds | None = None,
    ) -> None:
        self.companion = companion
        self.last: HoldOnExit | None = None
        self._wall, self._followed, self._signing = wall, followed, signing
        self._duplicates = None if isinstance(companion, DryRun) else duplicates
        self._gate = TakeoffInhibit(companion.system, signing)
        self._warned = False
        self._stamp = 0
        self._asked: dict[int, int] = {}
        self._answer: Answer | None = None
        self._rests_for = self._stepped = 0
        self.settled = followed is None or followed.known
        """Whether the rate of the own clock is known."""

    @property
    def name(self) -> str:
        """The companion's name."""
        return self.companion.name

    @property
    def barred(self) -> str:
        """The condition for which any order to take off has to wait; empty for none."""
        if self._duplicates is not None and self._duplicates.seen:
            return DUPLICATE
        return "" if self.settled else CLOCK

    def finish(self) -> None:
        """Let the companion fly its committed plan to the end, and make no other one."""
        self.companion.finish()

    @property
    def rested(self) -> bool:
        """Whether the companion flies nothing, or its plan has been at rest for ``SETTLING_US``."""
        return self.last is not None or self._rests_for >= SETTLING_US

    def give_up(self) -> None:
        """Replace the companion by the hold on exit, which sends no set-points.

        It requests the hold mode only if the companion controlled the vehicle. Called when the parent process
        is lost.
        """
        if self.last is None:
            pilot = self.companion.pilot
            ours = pilot.phase in OURS and not isinstance(self.companion, DryRun)
            self.last = HoldOnExit(
                self.companion.system, pilot.vehicle.heartbeat, self._signing, steered=ours
            )

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        """Step the companion, or the hold on exit after ``give_up``."""
        wall = self._wall.now()
        if self.last is not None:
            return self.last.step(wall, [datagram for datagram in inbox if datagram.link == "autopilot"])
        if not self.settled:
            inbox = [datagram for datagram in inbox if datagram.link not in _OTHERS]
        answers: list[Datagram] = []
        if (barred := self.barred) and not isinstance(self.companion, DryRun):
            inbox, answers = self._gate.closed(inbox)
        if barred == DUPLICATE:
            # The duplicate was unknown when the order was given.
            self.companion.pilot.take_back()
        if (barred == DUPLICATE) != self._warned:
            self._warned = barred == DUPLICATE
            self.companion.reporter.report(Severity.CRITICAL, "Own system id used twice", begins=self._warned)
        judges = self._followed is not None and self._followed.verdict is None
        self.companion.round_trips.always = judges and self._stamp > 0
        if self._duplicates is not None:
            self.companion.reporter.watch(self._duplicates.behind, BEHIND, f"Over: {BEHIND}")
        leaving = self.companion.step(now, inbox) + answers
        self._rests_for = self._rests_for + now - self._stepped if self.companion.rests(now) else 0
        self._stepped = now
        if judges:
            self._note_round_trips(now, wall)
        stamp = self.companion.world.stamp
        if self._followed is not None and stamp != self._stamp:
            self._stamp = stamp
            self._followed.observe(wall, stamp)
            self.companion.world.simulated = self._followed.simulated
        if not self.settled and self._followed is not None:
            self.settled = self._followed.known
            leaving = [datagram for datagram in leaving if datagram.link not in _OTHERS]
        return leaving

    def _note_round_trips(self, now: int, wall: int) -> None:
        """Tell the followed clock of the companion's round trips to the autopilot, in wall time."""
        trips = self.companion.round_trips
        if trips.requested == now:
            self._asked[now] = wall
            if len(self._asked) > _MAX_OPEN_REQUESTS:
                del self._asked[min(self._asked)]
        answer = trips.last
        if self._followed is None or answer is None or answer is self._answer:
            return
        self._answer = answer
        asked = self._asked.pop(answer.asked, None)
        if asked is not None:
            self._followed.answered(asked, wall, answer.stamp)
