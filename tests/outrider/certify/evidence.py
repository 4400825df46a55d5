"""Evidence without a flight: who told and stated what, and everybody heard it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np
from hypothesis import strategies as st

from companion.avoidance.certified.committed import carried_on, controls, resting, rests
from companion.avoidance.certified.fingerprint import FleetIdentity
from companion.values.horizon import Array
from mavlink_bridge.wire.agreements import Entry, Epochs, Statement
from mavlink_bridge.wire.plan import Integers, WirePlan
from outrider.certify.evidence import Evidence, FarewellChange, Log, LoggedPlan, LoggedStatement, Terms

DT = EPOCH = 200_000
"""µs."""
STEPS = 16
BEGAN = 1_767_225_600_000_000
REQUIRED = 1.2
COPIES = 4
"""A plan is told so often."""
IDENTITY = FleetIdentity(0xABCDEF12, 7)
TERMS = Terms((11, 12), frozenset(), DT, EPOCH, STEPS, IDENTITY, REQUIRED, (2000, 2000, 2000), False)


ABOUT_AGREEMENTS = frozenset(
    {
        "a new beginning that is not stated",
        "a departure without a farewell",
        "a plan beyond agreed planes",
        "a plan without a statement",
        "a plan without an agreement",
        "a return that is not stated",
        "a statement received that its sender did not send",
        "a statement of another fleet",
        "an agreement dropped",
        "an agreement nearer than the one before",
        "an agreement on a plan newer than the own one",
        "an agreement on a plan that was not received",
        "an agreement on a plan that was not sent",
        "an agreement taken again",
    }
)


def standing(place: Sequence[float], epoch: int = BEGAN) -> WirePlan:
    """To stand at ``place`` m."""
    return resting(epoch, DT, STEPS, place, TERMS.fleet_identity.origin)


def on(plan: WirePlan, epochs: int = 1) -> WirePlan:
    """The same, carried on."""
    return carried_on(plan, epochs)


def turned(plan: WirePlan, accelerations: Sequence[Integers]) -> WirePlan:
    """From where ``plan`` begins, with these ``accelerations`` (mm/s²), and then to rest."""
    missing = STEPS - 1 - len(accelerations)
    knots = (*accelerations, *((0, 0, 0),) * missing)
    x, y, z = (-v - sum(axis) for v, *axis in zip(plan.velocity, *knots, strict=True))
    return plan._replace(accelerations=(*knots, (x, y, z)))


def evidence(
    sent: Mapping[int, Sequence[WirePlan]],
    terms: Terms = TERMS,
    words: Mapping[int, Sequence[FarewellChange]] | None = None,
) -> Evidence:
    """Every plan of every vehicle is told half an epoch before it begins, and heard by all.

    Then all that told one state their agreements, with one on the new plans of each two, and state them once
    more when they have heard each other's.
    """
    told = Told(sent, terms._replace(fleet=tuple(sent)))
    for epoch in sorted({plan.epoch for plans in sent.values() for plan in plans}):
        told.of_epoch({system: [p for p in plans if p.epoch == epoch] for system, plans in sent.items()})
    return told.evidence(words or {})


class Told:
    """Logs of vehicles that all hear each other, as they are written epoch by epoch."""

    def __init__(self, systems: Iterable[int], terms: Terms) -> None:
        self._terms, self._number = terms, 0
        self._plans: dict[int, list[LoggedPlan]] = {system: [] for system in systems}
        self._statements: dict[int, list[LoggedStatement]] = {system: [] for system in systems}
        self._last: dict[int, WirePlan] = {}
        self._since = dict.fromkeys(self._plans, 0)
        self._heard_since = dict(self._since)
        self._lists: dict[tuple[int, int], tuple[Epochs, ...]] = {}

    def plan(self, sender: int, plan: WirePlan) -> None:
        """A plan, told by ``sender`` and heard by all."""
        self._number += 1
        for owner, plans in self._plans.items():
            plans.append(LoggedPlan(owner, sender, plan, plan.epoch - EPOCH // 2, COPIES, self._number))

    def state(self, sender: int, statement: Statement, time: int | None = None) -> None:
        """A statement, told by ``sender`` and heard by all."""
        self._number += 1
        at = statement.epoch - EPOCH // 2 if time is None else time
        for owner, statements in self._statements.items():
            statements.append(LoggedStatement(owner, sender, statement, at, self._number))

    def of_epoch(self, plans: Mapping[int, Sequence[WirePlan]]) -> None:
        """The plans of one epoch, and then the statements, twice."""
        speak = {}
        for sender, sent in plans.items():
            for plan in sent:
                self.plan(sender, plan)
                if _sound(plan):
                    speak[sender] = plan
        for sender, plan in speak.items():
            last = self._last.get(sender)
            goes_on = None if last is None else carried_on(last, (plan.epoch - last.epoch) // DT)
            axes = 2 if goes_on is not None and goes_on.column and not plan.column else 3
            begins = plan.position[:axes], plan.velocity
            if goes_on is None or begins != (goes_on.position[:axes], goes_on.velocity):
                self._since[sender] = plan.epoch
            self._last[sender] = plan
        for again in (False, True):
            for sender, plan in speak.items():
                entries = [self._entry(sender, peer, again=again) for peer in self._plans if peer != sender]
                fingerprint, since = self._terms.fleet_identity.fingerprint, self._since[sender]
                self.state(sender, Statement(fingerprint, plan.epoch, since, tuple(entries)))
            self._heard_since = dict(self._since)

    def _entry(self, sender: int, peer: int, *, again: bool) -> Entry:
        old = self._lists.get((sender, peer), ())
        kept = [one for one in old if one[0] >= self._since[sender] and one[1] >= self._heard_since[peer]]
        own, other = self._last[sender], self._last.get(peer)
        if other is not None and own.epoch == other.epoch:
            both = own.epoch, own.epoch
            kept = [both] if again else [*kept, both]
        self._lists[sender, peer] = tuple(kept)
        return Entry(peer, tuple(kept), kept[-1] if kept else (0, 0))

    def evidence(self, words: Mapping[int, Sequence[FarewellChange]] | None = None) -> Evidence:
        """All logs; ``words`` by system."""
        logs = [
            Log(
                owner,
                tuple(plans),
                tuple(self._statements[owner]),
                (),
                tuple((words or {}).get(owner, ())),
                0,
            )
            for owner, plans in self._plans.items()
        ]
        return Evidence(self._terms, tuple(logs))


def _sound(plan: WirePlan) -> bool:
    known = plan.origin == TERMS.fleet_identity.origin and plan.dt == DT and len(plan.accelerations) == STEPS
    return known and plan.epoch % EPOCH == 0 and rests(plan)


def restated(whole: Evidence, change: Callable[[LoggedStatement], Statement | None]) -> Evidence:
    """All statements as ``change`` has them, None to leave one out."""
    logs = []
    for log in whole.logs:
        pairs = [(one, change(one)) for one in log.statements]
        changed = tuple(one._replace(statement=new) for one, new in pairs if new is not None)
        logs.append(log._replace(statements=changed))
    return whole._replace(logs=tuple(logs))


def least_of_samples(one: WirePlan, other: WirePlan, count: int = 41) -> float:
    """Least distance (m) of two plans of one epoch, looked at ``count`` times on each segment."""
    s = np.linspace(0.0, 1.0, count)
    weights = np.stack([(1.0 - s) ** 2, 2.0 * s * (1.0 - s), s**2], axis=1)
    apart: Array = weights @ (controls(one) - controls(other))
    return float(np.linalg.norm(apart, axis=-1).min())


def hull_excess(one: WirePlan, other: WirePlan) -> float:
    """How far (m) a hull of control points may reach beyond its curve: |a| dt²/4 of the relative motion."""
    relative = one.accelerations_m_s2 - other.accelerations_m_s2
    return float(np.linalg.norm(relative, axis=1).max()) * (1e-6 * DT) ** 2 / 4


_axis = st.integers(-1000, 1000)
accelerations = st.lists(st.tuples(_axis, _axis, _axis), min_size=1, max_size=STEPS - 1)
places = st.tuples(*[st.floats(-2.0, 2.0)] * 3)
