"""The companion as the loop runs it: its clock follows the autopilot's, and if it is told to give up, the
last word is what it says.

Until it is known how fast that clock runs, nothing is heard or told of others, as what they say is dated by
their clocks against the own one, and no go is taken; nor while another has the own ids, when one that waits
is taken back.
"""

from __future__ import annotations

from collections.abc import Sequence

from companion.dry_run import DryRun
from companion.flight.hold_on_exit import LastWord
from companion.node import Companion
from companion.telemetry.status_text import Severity
from companion.values.phase import STEERED, Phase
from mavlink_bridge.clocks.clock import Clock
from mavlink_bridge.clocks.followed_clock import FollowedClock
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.signing import Signing
from outrider.supervision.duplicate_ids import Twin
from outrider.supervision.takeoff_inhibit import Gate

CLOCK = "the rate of the autopilot's clock"
TWIN = "the other companion with this system id to fall silent"
"""What any go has to wait for."""
OURS = (Phase.PREPARE, *STEERED, Phase.LAND)
"""The phases in which we have the vehicle: before and after, and when somebody took it, it is no business of
ours, in whatever mode it flies."""
_OTHERS = ("swarm", "target")


class Cockpit:
    """A ``Node``. ``followed``: shown the autopilot's stamps, as far as the companion believes them; None for
    a companion that lives by the wall's time. ``signing``: the companion's. ``twin``: looked for on its
    links; none is, of a dry run, which has other ids, as the companion may be there as well."""

    def __init__(
        self,
        companion: Companion,
        wall: Clock,
        followed: FollowedClock | None,
        signing: Signing | None,
        twin: Twin | None = None,
    ) -> None:
        self.companion = companion
        self.last: LastWord | None = None
        self._wall, self._followed, self._signing = wall, followed, signing
        self._twin = None if isinstance(companion, DryRun) else twin
        self._gate = Gate(companion.system, signing)
        self._warned = False
        self._stamp = 0
        self.settled = followed is None or followed.known
        """Whether the own clock's rate is known."""

    @property
    def name(self) -> str:
        """The companion's."""
        return self.companion.name

    @property
    def barred(self) -> str:
        """What any go has to wait for, whatever the companion says; empty for nothing."""
        if self._twin is not None and self._twin.seen:
            return TWIN
        return "" if self.settled else CLOCK

    def give_up(self) -> None:
        """Nobody looks after this process any more: no set-points from now on, but the last word."""
        if self.last is None:
            pilot = self.companion.pilot
            ours = pilot.phase in OURS and not isinstance(self.companion, DryRun)
            self.last = LastWord(self.companion.system, pilot.vehicle.heartbeat, self._signing, steered=ours)

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        """As the companion's."""
        wall = self._wall.now()
        if self.last is not None:
            return self.last.step(wall, [datagram for datagram in inbox if datagram.link == "autopilot"])
        if not self.settled:
            inbox = [datagram for datagram in inbox if datagram.link not in _OTHERS]
        answers: list[Datagram] = []
        if (barred := self.barred) and not isinstance(self.companion, DryRun):
            inbox, answers = self._gate.closed(inbox)
        if barred == TWIN:
            # Who gave it did not know of the other.
            self.companion.pilot.take_back()
        if (barred == TWIN) != self._warned:
            self._warned = barred == TWIN
            self.companion.voice.report(Severity.CRITICAL, "Own system id used twice", begins=self._warned)
        leaving = self.companion.step(now, inbox) + answers
        stamp = self.companion.world.stamp
        if self._followed is not None and stamp != self._stamp:
            self._stamp = stamp
            self._followed.observe(wall, stamp)
            self.companion.world.simulated = self._followed.simulated
        if not self.settled and self._followed is not None:
            self.settled = self._followed.known
            leaving = [datagram for datagram in leaving if datagram.link not in _OTHERS]
        return leaving
