"""Exchange of reports: what one vehicle has measured, in parts, and whose reports are complete."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from mavlink_bridge.wire.preflight import LINKS_PER_PART, LinkReport, Report
from outrider.preflight.link_meter import LinkMeter


class Exchange:
    """Reports of the vehicles in ``meters``, by system id, of a fleet with the ``fingerprint``."""

    def __init__(self, meters: Mapping[int, LinkMeter], fingerprint: int) -> None:
        self._meters, self._fingerprint = meters, fingerprint
        self._received: dict[int, dict[int, Report]] = {}

    def receive(self, system: int, part: Report) -> None:
        """Receive a part; those of another process of the same vehicle are discarded."""
        if part.fingerprint != self._fingerprint:
            return
        known = self._received.setdefault(system, {})
        if any(other.run != part.run or other.parts != part.parts for other in known.values()):
            known.clear()
        known[part.part] = part

    def refused(self) -> dict[int, str]:
        """Return why the report of a vehicle is of no use, by system id."""
        found = {}
        for system, meter in self._meters.items():
            if meter.doubled:
                found[system] = "two companions have this id"
            elif meter.fingerprint not in (None, self._fingerprint):
                found[system] = "has other common settings: another fleet file, origin, roster or limits"
        return found

    def awaited(self) -> dict[int, str]:
        """Return why there is no report of a vehicle yet, by system id."""
        found = {}
        for system in sorted(self._meters.keys() - self.refused().keys()):
            if not self._complete(system):
                heard = self._meters[system].fingerprint is not None
                found[system] = "no report: its own screen says what it waits for" if heard else "not heard"
        return found

    def _complete(self, system: int) -> bool:
        parts = self._received.get(system, {})
        return bool(parts) and len(parts) == next(iter(parts.values())).parts

    def reports(self) -> dict[int, Report]:
        """Return the complete reports that are of use, by system id."""
        missing = self.refused().keys() | self.awaited().keys()
        return {
            system: whole(list(parts.values()))
            for system, parts in self._received.items()
            if system not in missing
        }


def in_parts(report: Report, links: Sequence[LinkReport]) -> list[Report]:
    """Return ``report`` with ``links``, at least one, in as many parts as the payload needs."""
    groups = [tuple(links[k : k + LINKS_PER_PART]) for k in range(0, len(links), LINKS_PER_PART)]
    return [report._replace(part=k, parts=len(groups), links=group) for k, group in enumerate(groups)]


def whole(parts: Sequence[Report]) -> Report:
    """Return all parts of a report as one."""
    ordered = sorted(parts, key=lambda part: part.part)
    return ordered[0]._replace(links=tuple(link for part in ordered for link in part.links))
