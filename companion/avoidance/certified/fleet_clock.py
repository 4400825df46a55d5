"""Fleet time of one companion: its own clock, corrected by its sources and by messages of its peers.

Fleet time must not jump under a plan that others rely on: it runs up to 500 ppm faster or slower than the own
clock while its error is within ``clock_us``, and up to 1 % beyond. It jumps only while no plan has been
announced.
"""

from __future__ import annotations

from enum import Enum

from companion.avoidance.certified.clocks import ClockBounds
from companion.avoidance.certified.peer_times import PeerTimes
from companion.config.certified import CertifiedConfig
from companion.estimation.autopilot_time import AutopilotTime
from companion.estimation.fleet_time import Offset, agreed
from mavlink_bridge.clocks.system_clock import SystemClock
from mavlink_bridge.messages import Message, Source, SystemTime, Timesync, Tunnel
from mavlink_bridge.wire.fleet_time import PAYLOAD_TYPE, Estimate, FleetTime, pack

_PERIOD_US = 100_000
"""Time between two estimates, µs."""
_REPEAT_US = 500_000
"""Time between two messages of the own fleet time, µs."""
_SLEW_PPM, _FAST_SLEW_PPM = 500, 10_000
_LATEST_US = 1 << 55
"""Fleet times beyond it would not fit the wire with a plan that begins then."""
_MAX_BOUND_US = (1 << 32) - 1


class TimeTrouble(Enum):
    """Reason why fleet time is not good enough to make plans; the value is the text for the ground."""

    NO_SOURCE = "Fleet time has no source: plan held"
    DISAGREE = "Sources of fleet time disagree: plan held"
    UNCERTAIN = "Fleet time is too uncertain: plan held"
    CORRECTING = "Fleet time is being corrected: plan held"


class FleetClock:
    """Fleet time of the companion ``own``; ``system_clock`` reads that of its computer, if there is one."""

    def __init__(self, config: CertifiedConfig, own: Source, system_clock: SystemClock | None) -> None:
        self._config, self._own = config, own
        sources = config.time_sources
        self._system_clock = system_clock if sources.system else None
        self._autopilot = AutopilotTime(own, sources)
        self.peers = PeerTimes(own, frozenset(config.fleet), sources)
        self.ahead: int | None = None
        """Fleet time minus own time (µs); None until it is known within ``clock_us``."""
        self.trouble: TimeTrouble | None = TimeTrouble.NO_SOURCE
        """Why no plans are to be made; None while fleet time is good enough."""
        self.error = 0
        """Largest error (µs) that ``ahead`` may have, by the last estimate; 0 without one."""
        self._shared: Estimate | None = None
        self._estimate: Offset | None = None
        self._stepped = self._next = self._next_message = 0

    @property
    def idle(self) -> bool:
        """Whether no reply to another companion waits to be sent."""
        return self.peers.idle

    def step(self, now: int, *, free: bool) -> bool:
        """Bring ``ahead`` and ``trouble`` up to date at ``now`` (µs).

        ``free``: fleet time may jump, because nothing has been announced in it. Returns whether it has
        jumped. Further calls at the same time have no effect.
        """
        passed, self._stepped = now - self._stepped, now
        if self.ahead is not None and self._estimate is not None and passed > 0:
            fast = self.trouble is not None
            most = passed * (_FAST_SLEW_PPM if fast else _SLEW_PPM) // 1_000_000
            self.ahead += min(max(self._estimate.middle - self.ahead, -most), most)
        if now < self._next:
            return False
        self._next = now + _PERIOD_US
        return self._judge(now, free=free)

    def receive(self, now: int, link: str, message: SystemTime | Timesync | Tunnel) -> None:
        """Receive a message of the own autopilot, or of a companion on the swarm link."""
        if link == "swarm" and not isinstance(message, SystemTime):
            self.peers.receive(now, message)
        elif link == "autopilot" and not isinstance(message, Tunnel):
            self._autopilot.receive(now, message)

    def requests(self, now: int) -> list[Message]:
        """Return the messages for the autopilot at ``now`` (µs)."""
        return [*self._autopilot.due(now)]

    def messages(self, now: int) -> list[Message]:
        """Return the messages for the swarm link at ``now`` (µs)."""
        found: list[Message] = [*self.peers.messages(now)]
        if now >= self._next_message:
            self._next_message = now + _REPEAT_US
            payload = pack(FleetTime(now, self.ahead, self._shared))
            found.append(Tunnel(self._own, 0, 0, PAYLOAD_TYPE, payload))
        return found

    def differences(self, now: int) -> dict[int, ClockBounds]:
        """Return by how much the others' fleet times are ahead of the own one, by system id."""
        return {} if self.ahead is None else self.peers.differences(now, self.ahead)

    def _judge(self, now: int, *, free: bool) -> bool:
        """Make a new estimate, and judge ``ahead`` by it; return whether it has jumped."""
        sources, found = self._agree(now)
        if found is not None:
            self._estimate = found
        elif self._estimate is not None:
            self._estimate = self._estimate.aged(now, self._config.time_sources.drift_ppm)
        estimate, bound = self._estimate, self._config.clock_us
        if estimate is None or (sources and found is None):
            self.trouble = TimeTrouble.DISAGREE if sources else TimeTrouble.NO_SOURCE
            return False
        jumps = False
        if estimate.bound <= bound and (
            self.ahead is None or (free and abs(self.ahead - estimate.middle) > bound)
        ):
            self.ahead, jumps = estimate.middle, True
            # The backup node starts with this message.
            self._next_message = now
        if self.ahead is None:
            self.trouble = TimeTrouble.UNCERTAIN
            return False
        self.error = max(self.ahead - estimate.least, estimate.most - self.ahead)
        self.trouble = None if self.error <= bound else self._beyond(estimate, sources)
        return jumps

    def _beyond(self, estimate: Offset, sources: int) -> TimeTrouble:
        """Return why the error is beyond the bound."""
        if estimate.bound <= self._config.clock_us:
            return TimeTrouble.CORRECTING
        return TimeTrouble.UNCERTAIN if sources else TimeTrouble.NO_SOURCE

    def _agree(self, now: int) -> tuple[int, Offset | None]:
        """Return the number of sources, and what they agree on; also update the estimate for the others."""
        settings = self._config.time_sources
        if settings.reference is not None:
            reference = (
                Offset(0, 0, now)
                if settings.reference == self._own.system
                else self.peers.clock(now, settings.reference)
            )
            return int(reference is not None), reference
        own = self._own_sources(now)
        sources = [*own, *self.peers.estimates(now)]
        found = agreed(sources, settings.wrong, now)
        if found is not None and (now + found.least <= 0 or now + found.most >= _LATEST_US):
            found = None
        local = agreed(own, 0, now)
        contradicted = (
            local is not None and found is not None and local.narrowed(found, settings.drift_ppm) is None
        )
        shareable = local is not None and not contradicted and local.bound <= _MAX_BOUND_US
        self._shared = Estimate(local.middle, local.bound) if shareable and local is not None else None
        return len(sources), found

    def _own_sources(self, now: int) -> list[Offset]:
        """Return the offsets of system clock and autopilot, as far as they are known."""
        found = []
        reading = None if self._system_clock is None else self._system_clock(now)
        if reading is not None:
            found.append(Offset(reading.ahead - reading.bound, reading.ahead + reading.bound, now))
        autopilot = self._autopilot.offset(now)
        return found if autopilot is None else [*found, autopilot]
