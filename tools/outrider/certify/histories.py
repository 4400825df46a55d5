"""Plans of one vehicle, one for each epoch.

The plans sent are compared with those that the others received, and each plan with the previous one. Like a
receiver, this module refuses an invalid plan and relies on the previous one, carried on.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from enum import Enum
from itertools import zip_longest
from typing import NamedTuple

from companion.avoidance.certified.committed import carried_on, rests
from mavlink_bridge.wire.plan import WirePlan, pack
from outrider.certify.evidence import Finding, Log, LoggedPlan, Terms

_OLDEST, _AHEAD = 12, 4
"""Largest time (epochs) by which a plan may begin before it is sent or received, and after.

Receivers refuse a plan beyond it (``companion/avoidance/certified/agreements.py``).
"""
_AXES = ("east", "north", "up")


class Kind(Enum):
    """Relation of a plan to the one before."""

    FIRST = "begins"
    MADE = "made anew from where the plan before is"
    CARRIED_ON = "the plan before, carried on"
    RELEASED = "a column at rest that became a plan in space, at rest there"
    ANCHOR = "made anew from elsewhere"


class Step(NamedTuple):
    """Plan of one epoch."""

    plan: WirePlan
    kind: Kind


class Absence(NamedTuple):
    """Farewell at ``said`` (µs), and the epoch (µs) of the first plan after its withdrawal, if any."""

    said: int
    back: int | None


class History(NamedTuple):
    """Plans of one vehicle in the order of their epochs, and its absences."""

    system: int
    steps: tuple[Step, ...]
    leaves: tuple[Absence, ...]

    def left(self, epoch: int) -> bool:
        """Return whether the vehicle had said farewell before ``epoch`` (µs) began and was not yet back.

        It may then be landing, and its last plan is no longer flown.
        """
        return any(leave.said < epoch and (leave.back is None or epoch < leave.back) for leave in self.leaves)


def history(system: int, terms: Terms, logs: Sequence[Log]) -> tuple[History, list[Finding]]:
    """Return the plans that ``system`` sent, according to all ``logs``, and what is wrong with them."""
    own = next((log for log in logs if log.owner == system), None)
    by_epoch: dict[int, list[LoggedPlan]] = {}
    for log in logs:
        for sighting in log.sightings:
            if sighting.sender == system:
                by_epoch.setdefault(sighting.plan.epoch, []).append(sighting)
    findings: list[Finding] = []
    chosen = []
    for epoch in sorted(by_epoch):
        found = by_epoch[epoch]
        findings += _disagreements(system, found, logged=own is not None)
        sound = []
        for plan in dict.fromkeys(sighting.plan for sighting in found):
            of_it = [sighting for sighting in found if sighting.plan == plan]
            flaw = _flaw(plan, terms, [sighting.time for sighting in of_it])
            if flaw is None:
                last_sent = max((s.time for s in of_it if s.owner == system), default=0)
                sound.append((sum(s.copies for s in of_it), last_sent, plan))
            else:
                findings.append(Finding(flaw[0], (system,), of_it[0].time, flaw[1]))
        if sound:
            # Among several plans the one with most copies counts; on a tie the last sent, which is flown.
            chosen.append(max(sound)[-1])
    leaves = () if own is None else tuple(_leaves(own, chosen))
    steps = tuple(_steps(chosen, leaves))
    findings += [finding for step in steps for finding in _limits(system, step, terms)]
    return History(system, steps, leaves), findings


def _disagreements(system: int, found: Sequence[LoggedPlan], *, logged: bool) -> list[Finding]:
    """Return differences among the plans sent, and between those sent and received, of one epoch."""
    epoch = found[0].plan.epoch
    sent = list(dict.fromkeys(sighting.plan for sighting in found if sighting.owner == system))
    received = [sighting for sighting in found if sighting.owner != system and sighting.plan not in sent]
    findings = []
    if len(sent) > 1:
        figures = f"{len(sent)} plans; {_differ(sent[-1], sent[:-1])}"
        findings.append(Finding("two plans told of one epoch", (system,), epoch, figures))
    if received and logged and not sent:
        hearers = tuple(sorted({sighting.owner for sighting in received}))
        what = "a plan received that its sender did not send"
        return [Finding(what, (system, *hearers), received[0].time, f"its epoch is {epoch} µs")]
    reference = sent or [received[0].plan] if received else []
    for sighting in received:
        if sighting.plan not in reference:
            figures = _differ(sighting.plan, reference)
            findings.append(Finding("a plan altered", (system, sighting.owner), epoch, figures))
    return findings


def _differ(plan: WirePlan, others: Iterable[WirePlan]) -> str:
    """Return by how many bits a plan differs from the most similar one of ``others``."""
    bits = min((int.from_bytes(pack(plan)) ^ int.from_bytes(pack(other))).bit_count() for other in others)
    return f"{bits} bit differs" if bits == 1 else f"{bits} bits differ"


def _flaw(plan: WirePlan, terms: Terms, seen: Sequence[int]) -> tuple[str, str] | None:
    """Return why receivers refuse a plan that was sent or received at ``seen`` (µs): kind and figures.

    None if they accept it.
    """
    if not rests(plan):
        left = plan.states()[-1, 1] * 1e-3 * plan.dt * 1e-6
        return "a plan that does not end at rest", f"{float((left @ left) ** 0.5):.4f} m/s left"
    if plan.origin != terms.fleet_identity.origin:
        figures = f"fingerprint {plan.origin}, the fleet's is {terms.fleet_identity.origin}"
        return "a plan in another frame", figures
    if plan.dt != terms.dt or len(plan.accelerations) != terms.steps or plan.epoch % terms.epoch:
        knots = f"{len(plan.accelerations)} knots of {plan.dt} µs from {plan.epoch} µs"
        fleet = f"the fleet's are {terms.steps} of {terms.dt} µs from k·{terms.epoch} µs"
        return "a plan on other knots", f"{knots}; {fleet}"
    if not any(-_OLDEST <= (plan.epoch - time) / terms.epoch <= _AHEAD for time in seen):
        return "a plan of another time", f"begins {1e-6 * (plan.epoch - seen[0]):.1f} s after it was told"
    return None


def _leaves(own: Log, plans: Sequence[WirePlan]) -> Iterable[Absence]:
    """Yield each farewell, and the epoch of the first of ``plans`` that was sent after its withdrawal."""
    sent = {sighting.plan: sighting.time for sighting in own.sightings if sighting.sender == own.owner}
    for word, following in zip_longest(own.words, own.words[1:]):
        if word.farewell:
            again = [] if following is None else [p.epoch for p in plans if sent.get(p, 0) >= following.time]
            yield Absence(word.time, min(again, default=None))


def _steps(plans: Sequence[WirePlan], leaves: Sequence[Absence]) -> Iterable[Step]:
    """Yield each plan with its relation to the previous one.

    In a gap the previous plan is carried on: no vehicle can have received another one.
    """
    back = {leave.back for leave in leaves}
    last: WirePlan | None = None
    for plan in plans:
        if last is None or plan.epoch in back:
            kind = Kind.FIRST
        else:
            kind = _relation(carried_on(last, (plan.epoch - last.epoch) // plan.dt), plan)
        last = plan
        yield Step(plan, kind)


def _relation(goes_on: WirePlan, plan: WirePlan) -> Kind:
    """Return the relation of ``plan`` to the plan before, which ``goes_on`` is, carried on.

    Any plan may become a column. A column at rest may become a plan at any height.
    """
    if plan == goes_on._replace(column=plan.column) and plan.column >= goes_on.column:
        return Kind.CARRIED_ON
    leaves = goes_on.column and not plan.column
    if leaves and any(map(any, (goes_on.velocity, *goes_on.accelerations))):
        return Kind.ANCHOR
    axes = 2 if leaves else 3
    begins = goes_on.position[:axes], goes_on.velocity
    made = plan.column == goes_on.column or leaves
    if not made or (plan.position[:axes], plan.velocity) != begins:
        return Kind.ANCHOR
    return Kind.RELEASED if leaves and not any(map(any, plan.accelerations)) else Kind.MADE


def _limits(system: int, step: Step, terms: Terms) -> Iterable[Finding]:
    """Yield accelerations beyond the limits. A plan that is carried on was checked when it was made."""
    if step.kind is Kind.CARRIED_ON:
        return
    for axis, (name, most) in enumerate(zip(_AXES, terms.a_max, strict=True)):
        least = -most if terms.a_min is None else terms.a_min[axis]
        worst = max((a[axis] for a in step.plan.accelerations), key=lambda a: (max(a - most, least - a), a))
        if not least <= worst <= most:
            bound = f"at most {1e-3 * most:.3f}" if worst > most else f"at least {1e-3 * least:.3f}"
            figures = f"{1e-3 * worst:.3f} m/s² {name}, {bound}"
            yield Finding("an acceleration beyond the limits", (system,), step.plan.epoch, figures)
