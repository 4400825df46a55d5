"""Check for faults and partitions that overlap in time: the end of one would end the other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations
from math import inf
from typing import NamedTuple

from outrider.scenarios.faults import FaultPart, FromStart
from outrider.scenarios.links import PartitionPart


class _Cause(NamedTuple):
    kind: str
    systems: tuple[int, ...]


class _Period(NamedTuple):
    """Period in which ``what`` happens, from ``begin`` until before ``end`` (s); ``name`` as in the file."""

    name: str
    what: _Cause
    begin: float
    end: float


def overlaps(faults: Sequence[FaultPart], partitions: Sequence[PartitionPart]) -> Iterator[str]:
    """Yield a sentence for each pair of equal faults or partitions that overlap in time.

    Faults are equal if they have one kind and one vehicle, partitions if they have the same members. A
    clock's fault lasts the whole flight. Faults without an end are not checked, because no other fault ends
    them.
    """
    periods = []
    for index, fault in enumerate(faults):
        name, what = f"faults[{index}]", _Cause(fault.kind, (fault.vehicle,))
        if isinstance(fault, FromStart):
            periods.append(_Period(name, what, 0.0, inf))
        elif (lasts := getattr(fault, "for_s", None)) is not None:
            periods.append(_Period(name, what, fault.at_s, fault.at_s + lasts))
    for index, cut in enumerate(partitions):
        what = _Cause("partition", tuple(sorted(set(cut.members))))
        periods.append(_Period(f"partitions[{index}]", what, cut.at_s, cut.at_s + cut.for_s))
    for one, other in combinations(periods, 2):
        if one.what == other.what and max(one.begin, other.begin) < min(one.end, other.end):
            systems = ", ".join(map(str, one.what.systems))
            allowed = "one for each vehicle" if one.end == inf else "one after the other"
            yield (
                f"{one.name} and {other.name}: {one.what.kind} of {systems} twice at one time; "
                f"allowed: {allowed}"
            )
