"""Verdict on a run from its evidence."""

from __future__ import annotations

from typing import Any, NamedTuple

from outrider.certify import agreed_planes, fixed_obstacles
from outrider.certify.evidence import Evidence, Finding, Log, Terms
from outrider.certify.heights import heights
from outrider.certify.histories import History, Kind, history
from outrider.certify.lists import Listing, listings
from outrider.certify.pairs import Pairs, check
from outrider.certify.ranges import too_long


class Verdict(NamedTuple):
    """Verdict on a run; without ``findings``, which are in the order of time, the run is certified.

    ``agreements``: number of them, each counted once for the two vehicles that list it. ``kept``: number of
    pairs of a plan and an agreement that was checked. ``fixed``: the check against fixed obstacles;
    ``surface``: the least distance (m) from their surfaces. ``began``: the first epoch (µs), from which
    seconds are counted. ``outside``: how often the vehicles left their tubes, by their own statements, and by
    how much at most (m); the guarantee is suspended in that time.
    """

    histories: tuple[History, ...]
    pairs: Pairs
    agreements: int
    kept: int
    fixed: fixed_obstacles.Kept
    required: float
    surface: float
    damaged: int
    began: int
    outside: tuple[int, float]
    findings: tuple[Finding, ...]

    @property
    def certified(self) -> bool:
        """Whether there is no finding; pairs that were not checked give none."""
        return not self.findings

    def seconds(self, time: int) -> float:
        """Return ``time`` (µs) as seconds from the beginning."""
        return round(1e-6 * (time - self.began), 3)

    def steps(self, *kinds: Kind) -> list[tuple[int, int]]:
        """Return system id and epoch (µs) of all plans of these ``kinds``, by epoch."""
        found = [(h.system, s.plan.epoch) for h in self.histories for s in h.steps if s.kind in kinds]
        return sorted(found, key=lambda one: one[::-1])

    @property
    def plans(self) -> int:
        """Number of plans that were not carried on, anchors among them."""
        return len(self.steps(Kind.FIRST, Kind.MADE, Kind.RELEASED, Kind.ANCHOR))

    def line(self, finding: Finding) -> str:
        """Return a finding as text: kind, vehicles, time, figures."""
        who = ", ".join(map(str, finding.who))
        parts = [f"{finding.what}: {who}", f"{self.seconds(finding.time):g} s", finding.figures]
        return ", ".join(part for part in parts if part)

    def document(self) -> dict[str, Any]:
        """Return the verdict as JSON values.

        ``plans``: number of those that were not carried on, anchors among them; ``unchecked``: pairs left
        out, by reason; ``began_nearer``: pairs whose first plans were nearer than required.
        ``obstacles_checked``: number of pairs of a plan and a fixed obstacle near it.
        """
        pairs, nearest, obstacle = self.pairs, self.pairs.nearest, self.fixed.nearest
        return {
            "certified": self.certified,
            "vehicles": len(self.histories),
            "epochs": len(pairs.epochs),
            "pairs": pairs.checked,
            "unchecked": {"farewell": pairs.farewell, "resting": pairs.resting},
            "began_nearer": pairs.near,
            "least_m": None if nearest is None else nearest.distance,
            "least_s": None if nearest is None else self.seconds(nearest.epoch),
            "least_between": None if nearest is None else list(nearest.who),
            "required_m": self.required,
            "agreements": self.agreements,
            "planes_checked": self.kept,
            "obstacles_checked": self.fixed.checked,
            "least_to_obstacle_m": None if obstacle is None else obstacle.distance,
            "least_to_obstacle_s": None if obstacle is None else self.seconds(obstacle.time),
            "least_to_obstacle": None if obstacle is None else [obstacle.system, obstacle.obstacle],
            "required_to_obstacle_m": self.surface,
            "plans": self.plans,
            "carried_on": len(self.steps(Kind.CARRIED_ON)),
            "anchors": len(self.steps(Kind.ANCHOR)),
            "farewells": sum(len(history.leaves) for history in self.histories),
            "outside_tube": self.outside[0],
            "most_outside_m": round(self.outside[1], 2),
            "damaged_records": self.damaged,
            "findings": [
                {"what": f.what, "who": list(f.who), "when_s": self.seconds(f.time), "figures": f.figures}
                for f in self.findings
            ],
        }


def judge(evidence: Evidence) -> Verdict:
    """Return the verdict on a run."""
    terms, logs, obstacles = evidence
    histories, findings = [], _strange(terms, logs)
    for system in terms.fleet:
        found, wrong = history(system, terms, logs)
        histories.append(found)
        findings += wrong
    spans = heights(histories, logs)
    pairs = check(histories, terms, spans)
    began = min(pairs.epochs, default=0)
    listed, wrong = _listed(histories, terms, logs)
    kept = agreed_planes.check(histories, listed, terms)
    if terms.reach is not None:
        findings += [one for found in histories for one in too_long(found, terms.reach)]
    fixed = fixed_obstacles.check(histories, obstacles, terms, logs, spans)
    findings += [*pairs.findings, *wrong, *kept.findings, *fixed.findings, *_absent(histories, logs, began)]
    findings.sort(key=lambda finding: (finding.time, finding.who, finding.what, finding.figures))
    damaged = sum(log.damaged for log in logs)
    agreements = {frozenset(((one.owner, one.agreement[0]), (one.peer, one.agreement[1]))) for one in listed}
    return Verdict(
        tuple(histories),
        pairs,
        len(agreements),
        kept.checked,
        fixed,
        terms.required,
        terms.surface,
        damaged,
        began,
        _outside(logs),
        tuple(findings),
    )


def _outside(logs: tuple[Log, ...]) -> tuple[int, float]:
    """Return how often vehicles left their tubes by their own statements, and by how much (m) at most."""
    number, most = 0, 0.0
    for log in logs:
        before = 0.0
        for one in log.statements:
            if one.sender == log.owner and not one.statement.away:
                number += before == 0.0 < one.statement.outside
                before = one.statement.outside
                most = max(most, before)
    return number, most


def _listed(
    histories: list[History], terms: Terms, logs: tuple[Log, ...]
) -> tuple[list[Listing], list[Finding]]:
    """Return the agreements in the lists of all vehicles, and what is wrong with the lists."""
    by_system = {one.system: one for one in histories}
    sent = {log.owner: {s.statement for s in log.statements if s.sender == log.owner} for log in logs}
    listed, findings = [], []
    for log in logs:
        received: dict[int, list[int]] = {}
        for one in log.statements:
            if one.sender in sent and one.statement not in sent[one.sender]:
                received.setdefault(one.sender, []).append(one.time)
        findings += [
            Finding("a statement received that its sender did not send", (sender, log.owner), times[0], "")
            for sender, times in received.items()
        ]
        own = by_system.get(log.owner)
        if own is not None:
            found, wrong = listings(log, own, histories, terms)
            listed += found
            findings += wrong
    return listed, findings


def _strange(terms: Terms, logs: tuple[Log, ...]) -> list[Finding]:
    """Return findings for unreadable plans and statements, and for plans of unknown vehicles."""
    known = terms.apart.union(terms.fleet)
    findings = [
        Finding("what is no plan was sent as one", (one.sender, one.owner), one.time, f"{one.copies} times")
        for log in logs
        for one in log.garbled
    ]
    unknown = {s.sender: s.time for log in logs for s in log.sightings if s.sender not in known}
    findings += [
        Finding("a plan of one that is not of the fleet", (system,), time, "")
        for system, time in unknown.items()
    ]
    return findings


def _absent(histories: list[History], logs: tuple[Log, ...], began: int) -> list[Finding]:
    """Return findings for vehicles without a readable log or without a plan."""
    owners = {log.owner for log in logs}
    findings = [
        Finding(
            "no log of its own that can be read",
            (one.system,),
            began,
            "its plans are as received",
        )
        for one in histories
        if one.system not in owners
    ]
    findings += [
        Finding("no plan of its own", (one.system,), began, "nothing of it is certified")
        for one in histories
        if not one.steps
    ]
    return findings
