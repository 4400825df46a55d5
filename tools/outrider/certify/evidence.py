"""What a run leaves that tells of its plans, and what is found in it: values only."""

from __future__ import annotations

from typing import NamedTuple

from mavlink_bridge.wire.plan import Integers, WirePlan


class Terms(NamedTuple):
    """What the vehicles agreed on before they flew.

    ``fleet``: system ids that share committed plans; ``apart``: those whose plans are none of these. ``dt``
    and ``epoch`` in µs; ``steps``: knots of a plan; ``origin``: the fingerprint of its frame; ``required``:
    least distance (m) between two plans; ``a_max``: mm/s² on each axis; ``upright``: heights do not count.
    """

    fleet: tuple[int, ...]
    apart: frozenset[int]
    dt: int
    epoch: int
    steps: int
    origin: int
    required: float
    a_max: Integers
    upright: bool


class Sighting(NamedTuple):
    """A plan of ``sender`` in the log of ``owner``: at first at ``time`` (µs, the owner's clock), ``copies``
    in all."""

    owner: int
    sender: int
    plan: WirePlan
    time: int
    copies: int


class Garbled(NamedTuple):
    """Payloads that claim to be plans or rosters and are not: the first at ``time`` (µs)."""

    owner: int
    sender: int
    time: int
    copies: int


class Word(NamedTuple):
    """From ``time`` (µs) on the owner of a log says farewell in its rosters, or no longer does."""

    time: int
    farewell: bool


class Log(NamedTuple):
    """One vehicle's tlog. ``damaged``: its records that could not be read."""

    owner: int
    sightings: tuple[Sighting, ...]
    garbled: tuple[Garbled, ...]
    words: tuple[Word, ...]
    damaged: int


class Evidence(NamedTuple):
    """All of a run."""

    terms: Terms
    logs: tuple[Log, ...]


class Finding(NamedTuple):
    """Something that must not be: what, who (system ids), when (µs), and its figures."""

    what: str
    who: tuple[int, ...]
    time: int
    figures: str
