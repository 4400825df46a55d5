"""A dry run of ``outrider fly`` fed by recorded flights of real firmware: what would have been sent is sound,
and what is not sound is found out."""

from __future__ import annotations

import csv
import gzip
import json
from collections.abc import Callable
from math import hypot
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as mavlink

from companion.flight.setpoint import setpoint
from companion.planning import setpoints
from mavlink_bridge.messages import LocalPosition, SetpointLocal
from mavlink_bridge.tlog.log import TlogWriter, read_tlog
from mavlink_bridge.wire.codec import Codec
from outrider.resources import find
from outrider.scenarios.fly_config import FlyConfig
from outrider.yaml_files.yaml_file import load
from tests.outrider.said import Ended, Run

ROOT = Path(__file__).parents[3]
CUT, WHOLE = ROOT / "tests" / "data" / "doctor", ROOT.parent / "shared" / "tlogs"


class Flown(NamedTuple):
    """``least``: set-points, 50 a second while the vehicle knows where it is."""

    cut: str
    whole: str
    config: str
    system: int
    least: int


FLIGHTS = {
    "copter-full": Flown("copter-full", "ap_copter463_guided_full", "ardupilot", 9, 3000),
    "copter-pvy": Flown("copter-pvy", "ap_copter463_guided_pvy", "ardupilot", 1, 3200),
    "px4-pvay": Flown("px4-pvay", "px4_1161_offboard_pvay", "px4", 1, 6300),
}


def logs() -> list[object]:
    """Of each flight what is committed, and the whole where it lies beside the checkout."""
    found: list[object] = []
    for name, flown in FLIGHTS.items():
        found.append(pytest.param(flown, CUT / f"{flown.cut}.tlog.gz", id=name))
        whole = WHOLE / f"{flown.whole}.tlog"
        if whole.exists():
            found.append(pytest.param(flown, whole, id=f"{name}-whole", marks=pytest.mark.slow))
    return found


def dry_run_of_log(run: Run, log: Path, config: str, system: int, *more: str) -> Ended:
    return run(
        "fly", "--dry-run", f"--autopilot=tlog:{log}", f"--config={config}", f"--system={system}", *more
    )


def places(log: Path, system: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """When (µs) the vehicle said where it was, and where and how fast that is (n, 3), its own local NED."""
    codec = Codec(
        lambda identifier, sender, component: (
            (identifier, sender, component) == (mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED, system, 1)
        )
    )
    rows = [
        (record.time, *message.position_ned, *message.velocity_ned)
        for record in read_tlog(log)
        for message in codec.feed(record.frame)
        if isinstance(message, LocalPosition)
    ]
    values = np.array(rows)
    return values[:, 0], values[:, 1:4], values[:, 4:7]


@pytest.mark.slow
@pytest.mark.parametrize(("flown", "log"), logs())
def test_what_would_have_been_sent_is_sound(flown: Flown, log: Path, run: Run, tmp_path: Path) -> None:
    """Against the log and the limits themselves, not the figures that the command makes of them."""
    ended = dry_run_of_log(run, log, flown.config, flown.system, "--json", "--out=said")
    document = json.loads(ended.out)
    assert (ended.status, document["setpoint_faults"]) == (0, [])
    assert document["autopilot"] == {"ardupilot": "ArduPilot", "px4": "PX4"}[flown.config]
    with (tmp_path / "said" / "setpoints.csv").open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["who"] == "would"]
    assert len(rows) == document["setpoints"] >= flown.least
    # All of position, velocity, acceleration, yaw and yaw rate, in LOCAL_NED: what both firmwares track best.
    assert {(row["mask"], row["frame"]) for row in rows} == {("0", "1")}
    assert document["mask_counts"] == {"0x000": len(rows)}
    times = np.array([int(row["time_us"]) for row in rows])
    value = np.array([[float(x) for x in list(row.values())[2:12]] for row in rows])
    assert np.isfinite(value).all()
    limits = load(find("companions", flown.config), FlyConfig).companion.limits
    position, velocity, acceleration, yaw = value[:, 0:3], value[:, 3:6], value[:, 6:9], value[:, 9]
    assert np.linalg.norm(velocity, axis=1).max() <= hypot(*limits.v_max)
    assert np.linalg.norm(acceleration, axis=1).max() <= limits.a_total + 1e-3
    assert (abs(acceleration[:, 2]) <= limits.a_total).all()
    # Continuous: no gap once it began, and no step that flying does not explain.
    spans = np.diff(times) * 1e-6
    assert spans.max() <= 0.1
    steps = np.linalg.norm(np.diff(position, axis=0), axis=1)
    assert (steps <= hypot(*limits.v_max) * spans + 0.15).all()
    swings = abs((np.diff(yaw) + np.pi) % (2 * np.pi) - np.pi)
    # After a pause, however short, the yaw begins where the nose points.
    assert (swings <= 3.0 * spans + 0.02)[spans < 0.035].all()
    # In the vehicle's own frame, at the right time: where the log says that it was.
    said, place, speed = places(log, flown.system)
    known = (times >= said[0]) & (times <= said[-1])
    for axis in range(3):
        off = abs(position[known, axis] - np.interp(times[known], said, place[:, axis]))
        assert np.percentile(off, 99) < 0.5
        off = abs(velocity[known, axis] - np.interp(times[known], said, speed[:, axis]))
        assert np.percentile(off, 95) < 1.0
    # The nose: where it flies far from the target, which stands where the vehicle began, it looks there.
    north, east = (place[0, :2] - position[:, :2]).T
    far = (np.hypot(north, east) > 4.0) & (times > times[0] + 5_000_000)
    wrong = abs((yaw - np.arctan2(east, north) + np.pi) % (2 * np.pi) - np.pi)[far]
    assert far.sum() > 300
    assert np.median(wrong) < np.radians(20.0)


@pytest.fixture(scope="module")
def piece(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Take-off and a first turn of a copter."""
    path = tmp_path_factory.mktemp("piece") / "piece.tlog"
    records = list(read_tlog(CUT / "copter-full.tlog.gz"))
    with TlogWriter(path) as writer:
        for record in records:
            if record.time - records[0].time < 24_000_000:
                writer.write(record.time | record.link, record.link, record.frame)
    return path


def swapped(message: SetpointLocal, _count: int) -> SetpointLocal:
    north, east, down = message.position
    return message._replace(position=(east, north, -down))


def falling(message: SetpointLocal, _count: int) -> SetpointLocal:
    return message._replace(velocity=tuple(-part for part in message.velocity))


def jumping(message: SetpointLocal, count: int) -> SetpointLocal:
    north, east, down = message.position
    return message._replace(position=(north + 0.4 * (count % 100 == 0), east, down))


def late(message: SetpointLocal, _count: int) -> SetpointLocal:
    v = np.array(message.velocity)
    return message._replace(position=tuple((np.array(message.position) + 0.5 * v).tolist()))


MUTANTS: dict[str, tuple[Callable[[SetpointLocal, int], SetpointLocal], str]] = {
    "none": (lambda m, _: m, ""),
    "another frame": (swapped, "beside the vehicle"),
    "half a second off": (late, "beside the vehicle"),
    "velocities the other way": (falling, "velocities that lead"),
    "a jump": (jumping, "a jump of 0."),
}
SINGLE: dict[int, tuple[dict[str, Any], str]] = {
    350: ({"velocity": (9.0, 0.0, 0.0)}, "faster than"),
    400: ({"acceleration": (5.0, 5.0, 0.0)}, "more than 4.0"),
    450: ({"yaw_rate": 9.0}, "turning faster"),
    500: ({"type_mask": 0x9C0}, "type masks other than 0x000"),
    550: ({"frame": 8}, "frames other than 1"),
}
"""Faults of one message each, by its number. Each has words of its own, so one flight has them all."""
MUTANTS |= {
    "the nose turned": (lambda m, n: m._replace(yaw=m.yaw + 0.5 * (n == 500)), "rad"),
    "not a number": (
        lambda m, n: m._replace(velocity=(float("nan"), 0.0, 0.0)) if n == 500 else m,
        "not all are finite",
    ),
}


@pytest.mark.parametrize("name", MUTANTS)
def test_what_is_not_sound_is_found_out(
    name: str, piece: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A companion with a fault in what it sends, one at a time; and one without."""
    mutant, words = MUTANTS[name]
    ended, wrong = mutated_run(mutant, piece, run, monkeypatch)
    assert ended.status == (1 if words else 0)
    assert any(words in line for line in wrong) if words else not wrong


def test_what_is_not_sound_in_single_messages_is_found_out(
    piece: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def spoilt(message: SetpointLocal, count: int) -> SetpointLocal:
        return message._replace(**SINGLE[count][0]) if count in SINGLE else message

    ended, wrong = mutated_run(spoilt, piece, run, monkeypatch)
    assert ended.status == 1
    for _, words in SINGLE.values():
        assert any(words in line for line in wrong), words


def mutated_run(
    mutant: Callable[[SetpointLocal, int], SetpointLocal],
    piece: Path,
    run: Run,
    monkeypatch: pytest.MonkeyPatch,
) -> tuple[Ended, list[str]]:
    """A dry run with changed set-points, and its lines on what is wrong."""
    count = 0

    def mutated(*arguments: object) -> SetpointLocal:
        nonlocal count
        count += 1
        return mutant(setpoint(*arguments), count)  # type: ignore[arg-type]

    monkeypatch.setattr(setpoints, "setpoint", mutated)
    monkeypatch.setattr(setpoints, "is_finite", lambda _message: True)
    ended = dry_run_of_log(run, piece, "ardupilot", 9)
    return ended, [line for line in ended.err.splitlines() if line.startswith("wrong: ")]


def test_who_would_have_sent_nothing_is_not_well(piece: Path, run: Run, tmp_path: Path) -> None:
    log = tmp_path / "short.tlog"
    records = list(read_tlog(piece))
    with TlogWriter(log) as writer:
        for record in records:
            if record.frame[7] != mavlink.MAVLINK_MSG_ID_ATTITUDE:
                writer.write(record.time | record.link, record.link, record.frame)
    ended = dry_run_of_log(run, log, "ardupilot", 9)
    assert (ended.status, "wrong: no set-point at all" in ended.err) == (1, True)


def test_who_is_there_and_what_is_allowed_is_said(run: Run, tmp_path: Path) -> None:
    copter, submarine = CUT / "copter-full.tlog.gz", CUT / "submarine.tlog.gz"
    ended = dry_run_of_log(run, copter, "ardupilot", 1)
    assert (ended.status, ended.err.count("\n")) == (2, 1)
    assert "there: 9 (ArduPilot); allowed: --system 9" in ended.err
    ended = dry_run_of_log(run, submarine, "ardupilot", 1)
    assert (ended.status, "never knows where on the globe it is" in ended.err) == (2, True)
    ended = dry_run_of_log(run, CUT / "quadrotor.tlog.gz", "ardupilot", 1)
    assert (ended.status, "allowed: one near -35.36" in ended.err) == (2, True)
    empty = tmp_path / "empty.tlog.gz"
    with gzip.open(empty, "wb"):
        pass
    ended = dry_run_of_log(run, empty, "px4", 1)
    assert (ended.status, ended.err.count("\n")) == (2, 1)


def test_a_log_flies_nothing(run: Run) -> None:
    log = f"--autopilot=tlog:{CUT / 'copter-full.tlog.gz'}"
    for more, words in (
        ((), "--dry-run"),
        (("--dry-run", "--swarm=mcast:,127.0.0.1"), "does not go with a log"),
    ):
        ended = run("fly", log, "--config=ardupilot", *more)
        assert (ended.status, words in ended.err) == (2, True)
