"""What the tests of exports share: a short flight with all there is, and its logs as pymavlink reads them."""

from __future__ import annotations

import math
import random
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from pymavlink.dialects.v20 import ardupilotmega
from shipped import FIREFLY, scenario

from mavlink_bridge.tlog.log import TlogWriter, read_tlog
from mavlink_bridge.wire.framing import frame_v2
from outrider.__main__ import main
from outrider.simulation.preparation import Prepared
from outrider.swarm import command as swarm

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


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three vehicles swap places past a post, among things that move."""
    directory = tmp_path_factory.mktemp("flown") / "run"
    directory.mkdir()
    of = scenario(
        "antipodal-8",
        vehicles=3,
        airborne=True,
        cap_s=1.5,
        starts={"radius": 3.0, "jitter": 0.0},
        obstacles=[
            {"kind": "post", "at": [6.0, 6.0], "radius": 0.3, "height": 8.0},
            {"kind": "sphere", "at": [-6.0, 6.0, 5.0], "radius": 0.5},
        ],
        moving=[
            {"kind": "sphere", "through": [[9, 0, 5], [8, 3, 5], [9, 6, 5]], "speed": 1.0, "radius": 0.4},
            {"kind": "post", "through": [[-9, 0], [-8, 3], [-9, 6]], "speed": 1.0, "radius": 0.4},
        ],
    )
    swarm.fly(Prepared(of, FIREFLY), 1, directory, lambda _stage, _seconds: None)
    return directory


@pytest.fixture
def export(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Export:
    """The command as a script sees it."""

    def call(*arguments: object) -> Ended:
        monkeypatch.setattr(sys, "argv", ["outrider", "export", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        code = ended.value.code or 0
        assert isinstance(code, int)
        said = Ended(code, *capsys.readouterr())
        assert "Traceback" not in said.err
        return said

    return call


def heard(log: Path) -> list[Heard]:
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
