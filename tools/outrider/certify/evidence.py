"""Values that describe the recorded plans of a run, and the findings about them."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from companion.avoidance.certified.fingerprint import FleetIdentity
from companion.config.obstacles import Obstacle
from mavlink_bridge.wire.agreements import Statement
from mavlink_bridge.wire.plan import Integers, WirePlan


class Reach(NamedTuple):
    """Limited range of a fleet.

    ``range`` (m) within which two vehicles hear each other in ``contact`` (µs); ``margins`` (m): by how much
    the distance of two vehicles may differ from that of their plans; ``sides`` (m): of the box that holds a
    plan; ``speed`` (m/s): at most that of plans.
    """

    range: float
    contact: int
    margins: float
    sides: tuple[float, float, float]
    speed: float


class Terms(NamedTuple):
    """Terms that the vehicles agreed on before the flight.

    ``fleet``: system ids that share committed plans, which are judged; ``apart``: system ids of moving
    obstacles, whose plans are not judged. ``dt``: time between knots (µs); ``epoch``: time between plans
    (µs); ``steps``: number of knots of a plan; ``fleet_identity``: fingerprints in plans and statements;
    ``required``: least distance (m) between two plans; ``a_max``: largest acceleration on each axis (mm/s²),
    and ``a_min`` the least, by default −a_max; ``upright``: whether only horizontal distances count;
    ``further``: what each column adds to the least distance (m); ``downwash``: number by which differences in
    height are divided; ``surface``: least distance (m) of a plan from the surface of a fixed obstacle;
    ``reach``: the limited range, if there is one; ``shift``: how far planes move with both plans, 0…0.9.
    """

    fleet: tuple[int, ...]
    apart: frozenset[int]
    dt: int
    epoch: int
    steps: int
    fleet_identity: FleetIdentity
    required: float
    a_max: Integers
    upright: bool
    further: float = 0.0
    downwash: float = 1.0
    surface: float = 0.0
    reach: Reach | None = None
    a_min: Integers | None = None
    shift: float = 0.0


def milli(values: tuple[float, float, float]) -> Integers:
    """Return three values in thousandths."""
    x, y, z = (round(1e3 * value) for value in values)
    return x, y, z


class LoggedPlan(NamedTuple):
    """Plan of ``sender`` in the log of ``owner``.

    ``time``: of its first copy (µs, the owner's clock); ``copies``: their number; ``number``: number of the
    first copy's record in the log.
    """

    owner: int
    sender: int
    plan: WirePlan
    time: int
    copies: int
    number: int


class LoggedStatement(NamedTuple):
    """Statement of ``sender`` in the log of ``owner``, at ``time`` (µs); ``number``: of its record.

    Of a received statement without a farewell only the first copy counts.
    """

    owner: int
    sender: int
    statement: Statement
    time: int
    number: int


class Order(NamedTuple):
    """Order of the companion to its autopilot to take off or to land, at ``time`` (µs, the owner's clock).

    ``climbs``: the order is to take off. ``number``: number of the record in the log.
    """

    time: int
    climbs: bool
    number: int


class UnreadablePayloads(NamedTuple):
    """Payloads of the type of plans or statements that cannot be read.

    ``time``: of the first one (µs); ``copies``: their number.
    """

    owner: int
    sender: int
    time: int
    copies: int


class FarewellChange(NamedTuple):
    """Change at ``time`` (µs): from then on the owner's statements have the farewell flag, or lack it."""

    time: int
    farewell: bool


class Log(NamedTuple):
    """Contents of one vehicle's tlog.

    ``statements`` and ``orders``: in the order of the log; of a repeated order the first, until the owner
    begins anew. ``damaged``: number of records that could not be read.
    """

    owner: int
    sightings: tuple[LoggedPlan, ...]
    statements: tuple[LoggedStatement, ...]
    garbled: tuple[UnreadablePayloads, ...]
    words: tuple[FarewellChange, ...]
    damaged: int
    orders: tuple[Order, ...] = ()


class Evidence(NamedTuple):
    """Terms and logs of a run, and the fixed ``obstacles`` with which each vehicle is configured, by id."""

    terms: Terms
    logs: tuple[Log, ...]
    obstacles: Mapping[int, tuple[Obstacle, ...]] = MappingProxyType({})


class Finding(NamedTuple):
    """Violation: kind, system ids, time (µs) and figures."""

    what: str
    who: tuple[int, ...]
    time: int
    figures: str
