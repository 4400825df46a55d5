"""What the tests of exports share: a short flight with all there is, and its logs as pymavlink reads them."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega

from mavlink_bridge.tlog.log import TlogWriter, read_tlog
from mavlink_bridge.wire.framing import frame_v2

SYSTEMS = (11, 12, 13)


class Ended(NamedTuple):
    status: int
    out: str
    err: str


Export = Callable[..., Ended]


class Heard(NamedTuple):
    """A message as pymavlink decodes it; ``time`` Unix µs."""

    time: int
    link: int
    system: int
    component: int
    name: str
    fields: dict[str, Any]


def received(log: Path) -> list[Heard]:
    """All of a log, decoded by pymavlink alone; texts up to the first NUL."""
    parser = ardupilotmega.MAVLink(None)
    found = []
    for record in read_tlog(log):
        message = parser.decode(bytearray(record.frame))
        fields = {name: getattr(message, name) for name in message.fieldnames}
        for name in fields:
            raw = getattr(message, f"_{name}_raw", None)
            if raw is not None:
                fields[name] = raw.split(b"\0")[0].decode("utf-8", "replace")
        who = message.get_srcSystem(), message.get_srcComponent()
        found.append(Heard(record.time, record.link, *who, message.get_type(), fields))
    return found


def everything(path: Path, seed: int = 1, most: int = 3) -> None:
    """A log with every message of the dialect, ``most`` of each, and in them whatever fits into the bytes."""
    chance = random.Random(seed)
    with TlogWriter(path) as writer:
        time = 1_700_000_000_000_000
        for number in sorted(ardupilotmega.mavlink_map) * most:
            definition = ardupilotmega.mavlink_map[number]
            payload = chance.randbytes(definition.unpacker.size)
            frame = frame_v2(number, bytes((definition.crc_extra,)), (1, 1), 0, payload)
            time += 4 * chance.randrange(10_000)
            writer.write(time, 0, frame)


def same(found: Any, expected: Any) -> bool:
    """Whether two values are equal; NaN is NaN."""
    if isinstance(expected, float):
        return bool(found == expected) or (math.isnan(expected) and math.isnan(found))
    return bool(found == expected)


def all_same(found: Iterable[Any], expected: Iterable[Any]) -> bool:
    """The same of each."""
    return all(same(one, other) for one, other in zip(found, expected, strict=True))
