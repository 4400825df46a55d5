"""Runs to certify: flown, copied and rewritten; and the command as a script sees it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

from mavlink_bridge.messages import Message, Tunnel
from mavlink_bridge.tlog.log import Record, TlogWriter, read_tlog
from mavlink_bridge.wire.codec import Codec
from outrider.scenarios.options import Options, apply
from outrider.simulation.preparation import Prepared
from outrider.swarm import command as swarm
from tests.outrider.shipped import FIREFLY, scenario


class Ended(NamedTuple):
    status: int
    out: str
    err: str


Replay = Callable[..., Ended]
Change = Callable[[Tunnel], Tunnel | None]


CERTIFIED = Options(avoidance="certified")
PLANAR = CERTIFIED._replace(planar=True)
LOSSY = PLANAR._replace(loss=0.3, delay_ms=60.0)
SLOW = PLANAR._replace(loss=0.6, delay_ms=200.0)


def fly(
    directory: Path,
    vehicles: int,
    *,
    airborne: bool = True,
    seed: int = 1,
    cap_s: float = 5.0,
    options: Options = CERTIFIED,
) -> Path:
    """A swap of places, as the command flies it."""
    directory.mkdir()
    of = scenario(
        "antipodal-8",
        vehicles=vehicles,
        airborne=airborne,
        cap_s=cap_s,
        starts={"radius": 3.0, "jitter": 0.0},
    )
    swarm.fly(Prepared(apply(of, options), FIREFLY), seed, directory, lambda _stage, _seconds: None)
    return directory


def rewrite(log: Path, change: Change, *, rest: bool = True) -> None:
    """Every TUNNEL of a log as ``change`` has it, None to leave it out, with sound checksums; and the
    ``rest``."""
    records = list(read_tlog(log))
    codec = Codec()
    with TlogWriter(log) as writer:
        for record, message in tunnels(records):
            if not isinstance(message, Tunnel):
                if rest:
                    writer.write(record.time | record.link, record.link, record.frame)
                continue
            changed = change(message)
            if changed is not None:
                writer.write(record.time | record.link, record.link, codec.encode(changed))


def tunnels(records: list[Record]) -> Iterator[tuple[Record, Message | None]]:
    codec = Codec(lambda identifier, _system, _component: identifier == 385)
    for record in records:
        found = codec.feed(record.frame)
        yield record, found[0] if found else None
