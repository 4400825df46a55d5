"""Two vehicles whose plans and statements arrive where a test says so."""

from __future__ import annotations

from companion.avoidance.certified.agreements import Agreements
from companion.avoidance.certified.columns import Distances
from companion.avoidance.certified.committed import committed, resting
from companion.avoidance.certified.fingerprint import FleetIdentity
from companion.avoidance.certified.negotiation import Geometry
from companion.config.certified import CertifiedConfig
from companion.values.horizon import Array
from mavlink_bridge.wire.agreements import Entry, Statement
from mavlink_bridge.wire.plan import WirePlan, pack
from tests.companion.avoidance.certified.plans import DT, EPOCH, STEPS

OWN, OTHER, THIRD = 1, 2, 3
FRAME = 0xABCDEF07
LENGTH = 200_000
NOW = EPOCH + 30_000
DISTANCES = Distances(1.0, 0.25)


def agreements(own: int = OWN, *expected: int) -> Agreements:
    config = CertifiedConfig(epoch_us=LENGTH, dt_us=DT, fleet=expected)
    one = Agreements(
        own,
        config,
        STEPS,
        FleetIdentity(FRAME, FRAME & 0xFF),
        Geometry(DISTANCES.apart, DISTANCES.agreed),
    )
    one.begin(EPOCH)
    return one


def plan(number: int = 0, x: float = 0.0, speed: float = 0.0) -> WirePlan:
    """From (x, 0, 5) m on, from epoch ``number`` on, braking from ``speed`` (m/s)."""
    start = resting(epoch(number), DT, STEPS, (x, 0.0, 5.0), FRAME & 0xFF)
    start = start._replace(velocity=(round(speed / (1e-9 * DT)), 0, 0))
    slowing: Array = -start.velocity_m_s / (1e-6 * DT * STEPS) + 0.0 * start.accelerations_m_s2
    return committed(start, slowing)


def epoch(number: int) -> int:
    return EPOCH + number * LENGTH


def statement(number: int, *entries: Entry, since: int = 0, farewell: bool = False) -> Statement:
    return Statement(FRAME, epoch(number), epoch(since), entries, farewell)


class Two:
    """Two vehicles whose plans and statements arrive at once where a test says so."""

    def __init__(self) -> None:
        self.first, self.second = agreements(OWN, OWN, OTHER), agreements(OTHER, OWN, OTHER)
        self.plans: dict[int, WirePlan] = {}

    def make(self, system: int, made: WirePlan) -> None:
        (self.first if system == OWN else self.second).made(made)
        self.plans[system] = made

    def tell(self, system: int, now: int) -> None:
        """``system`` announces its newest plan and its agreements, and the other hears it."""
        sender, receiver = (self.first, self.second) if system == OWN else (self.second, self.first)
        made = self.plans[system]
        sender.update(now)
        receiver.receive_plan(now, system, pack(made))
        entries = sender.entries(every=True)
        receiver.receive_statement(now, system, Statement(FRAME, made.epoch, sender.since, entries))
        receiver.update(now)

    def agree(self, now: int) -> None:
        for system in (OWN, OTHER, OWN, OTHER):
            self.tell(system, now)


def agreed() -> Two:
    """Two at rest, 4 m apart, that have agreed on their plans of the first epoch."""
    two = Two()
    two.make(OWN, plan())
    two.make(OTHER, plan(x=4.0))
    two.agree(NOW)
    return two


def doubled(one: Agreements) -> tuple[int, ...]:
    return one.refused_senders(NOW).doubled


def leaving(number: int = 0) -> Statement:
    return statement(number, Entry(OWN, considered=(epoch(number), EPOCH)), farewell=True)
