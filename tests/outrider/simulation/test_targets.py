"""Targets: what they send, when they send it, and where they truly are."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import GlobalPosition, Heartbeat, Source
from mavlink_bridge.tlog.log import TlogWriter, read_tlog
from mavlink_bridge.wire.codec import Codec
from outrider.errors import InputError
from outrider.scenarios.scenario import TARGET_SYSTEM, FixedTarget, RecordedTarget
from outrider.simulation.targets import LINK, SHORT, Recorded, StandingTarget, load
from tests.outrider.shipped import LOGS, scenario

ESCORT = scenario("escort")
assert isinstance(ESCORT.target, RecordedTarget)
CONFIG: RecordedTarget = ESCORT.target
LOG = LOGS / CONFIG.log
FLEET = FleetFrame(ESCORT.origin.latitude, ESCORT.origin.longitude, ESCORT.origin.altitude)
START = 1_767_225_600_000_000
TICK = 10_000


def wanted() -> list[tuple[int, bytes]]:
    """The records of the log within the piece: µs after the first of them, and the frame."""
    records = list(read_tlog(LOG))
    begin = records[0].time + round(CONFIG.start_s * 1e6)
    piece = [r for r in records if begin <= r.time <= begin + round(CONFIG.duration_s * 1e6)]
    return [(r.time - piece[0].time, r.frame) for r in piece]


def played(target: Recorded, until: int, tick: int = TICK) -> list[tuple[int, bytes]]:
    """What it sends after ``begin``, and when."""
    target.begin(START)
    out: list[tuple[int, bytes]] = []
    for now in range(START, START + until, tick):
        for datagram in target.step(now, []):
            assert datagram.link == LINK
            out.append((now - START, datagram.data))
    return out


# Recorded


def test_recorded_frames_are_sent_byte_for_byte_at_their_times() -> None:
    sent = played(Recorded(CONFIG, LOG, FLEET), 61_000_000)
    records = wanted()
    assert len(records) == 171
    assert [frame for _, frame in sent] == [frame for _, frame in records]
    late = np.array([time for time, _ in sent]) - np.array([time for time, _ in records])
    assert late.min() >= 0
    assert late.max() < TICK


@pytest.mark.parametrize("tick", [2_500, 10_000, 1_000_000])
def test_no_frame_is_lost_or_repeated_whatever_the_tick(tick: int) -> None:
    sent = played(Recorded(CONFIG, LOG, FLEET), 62_000_000, tick)
    assert [frame for _, frame in sent] == [frame for _, frame in wanted()]


def test_nothing_is_sent_before_the_goal_event() -> None:
    target = Recorded(CONFIG, LOG, FLEET)
    assert [target.step(START + k * TICK, []) for k in range(50)] == [[]] * 50
    assert target.system == CONFIG.system


def test_truth_is_the_log_at_its_records_and_a_line_between() -> None:
    target = Recorded(CONFIG, LOG, FLEET)
    times, places = target.recording.times, target.recording.positions
    codec = Codec()
    target.begin(START)
    for (time, frame), place in zip(wanted(), places, strict=True):
        (message,) = codec.feed(frame)
        assert isinstance(message, GlobalPosition)
        there = target.position(START + time)
        assert there is not None
        assert np.allclose(there, FLEET.to_enu(message.latitude, message.longitude, message.altitude))
        assert np.array_equal(there, place)
    for (before, a), (after, b) in pairwise(zip(times, places, strict=True)):
        middle = target.position(START + int(before + after) // 2)
        assert middle is not None
        assert np.allclose(middle, (a + b) / 2.0, atol=1e-4)


def test_truth_waits_at_the_first_place_and_is_gone_after_the_last() -> None:
    target = Recorded(CONFIG, LOG, FLEET)
    first = target.recording.positions[0]
    for now in (0, START, START + 10_000_000):
        there = target.position(now)
        assert there is not None
        assert np.array_equal(there, first)
    target.begin(START)
    last = int(target.recording.times[-1])
    there = target.position(START + last)
    assert there is not None
    assert np.array_equal(there, target.recording.positions[-1])
    assert target.position(START + last + 1) is None
    assert target.position(START + 10 * last) is None


def test_the_recorded_target_starts_near_the_fleet_s_origin() -> None:
    first = Recorded(CONFIG, LOG, FLEET).recording.positions[0]
    assert np.hypot(first[0], first[1]) < 1.0


# Made logs


def position(system: int, east: float) -> bytes:
    latitude, longitude, altitude = FLEET.to_geodetic((east, 0.0, 5.0))
    return Codec().encode(
        GlobalPosition(Source(system, 1), 0, latitude, longitude, altitude, 5.0, (0.0, 0.0, 0.0), None)
    )


def written(path: Path, records: list[tuple[int, bytes]]) -> Path:
    with TlogWriter(path) as log:
        for time, frame in records:
            log.write(START + time, 0, frame)
    return path


def piece(start_s: float, duration_s: float, system: int = 1) -> RecordedTarget:
    return RecordedTarget(
        kind="recorded", log="made.tlog", system=system, start_s=start_s, duration_s=duration_s
    )


def test_only_the_named_system_is_followed(tmp_path: Path) -> None:
    beat = Codec().encode(Heartbeat(Source(1, 1), 2, 3, 0, 0, 4))
    records = [(k * 100_000, position(1 + k % 2, float(k))) for k in range(40)]
    log = written(tmp_path / "made.tlog", [record for pair in records for record in (pair, (pair[0], beat))])
    for system in (1, 2):
        recording = load(piece(0.0, 3.9, system), log, FLEET)
        assert recording.frames == tuple(frame for _, frame in records if frame[5] == system)
        assert np.allclose(recording.positions[:, 0], np.arange(system - 1.0, 40.0, 2.0), atol=0.02)


@settings(deadline=None, max_examples=30)
@given(st.lists(st.integers(0, 30_000_000), min_size=2, max_size=30))
def test_a_log_whose_time_steps_back_is_played_in_order_of_time(
    tmp_path_factory: pytest.TempPathFactory, offsets: list[int]
) -> None:
    times = [0, *(offset & ~3 for offset in offsets), 30_000_000]
    records = [(time, position(1, float(k))) for k, time in enumerate(times)]
    log = written(tmp_path_factory.mktemp("back") / "made.tlog", records)
    target = Recorded(piece(0.0, 30.0), log, FLEET)
    in_order = sorted(records, key=lambda record: record[0])
    assert [frame for _, frame in played(target, 30_100_000, 100_000)] == [frame for _, frame in in_order]
    assert (np.diff(target.recording.times) >= 0).all()


# Logs that cannot be used


def truncated(folder: Path) -> tuple[RecordedTarget, Path]:
    path = folder / "cut.tlog"
    path.write_bytes(LOG.read_bytes()[: LOG.stat().st_size // 2 + 5])
    return CONFIG, path


def missing(folder: Path) -> tuple[RecordedTarget, Path]:
    return CONFIG, folder / "nowhere.tlog"


def no_log(folder: Path) -> tuple[RecordedTarget, Path]:
    path = folder / "noise.tlog"
    path.write_bytes(bytes(range(256)) * 20)
    return CONFIG, path


def empty(folder: Path) -> tuple[RecordedTarget, Path]:
    path = folder / "empty.tlog"
    path.touch()
    return CONFIG, path


def a_folder(folder: Path) -> tuple[RecordedTarget, Path]:
    return CONFIG, folder


def no_such_system(_: Path) -> tuple[RecordedTarget, Path]:
    return CONFIG.model_copy(update={"system": 7}), LOG


def too_long(_: Path) -> tuple[RecordedTarget, Path]:
    return CONFIG.model_copy(update={"duration_s": 65.0 + 2.0 * SHORT}), LOG


def beyond(_: Path) -> tuple[RecordedTarget, Path]:
    return CONFIG.model_copy(update={"start_s": 1e6}), LOG


def too_short(_: Path) -> tuple[RecordedTarget, Path]:
    return CONFIG.model_copy(update={"duration_s": 1e-6}), LOG


@pytest.mark.parametrize(
    "case", [truncated, missing, no_log, empty, a_folder, no_such_system, too_long, beyond, too_short]
)
def test_a_log_that_cannot_be_used_is_one_line(
    case: Callable[[Path], tuple[RecordedTarget, Path]], tmp_path: Path
) -> None:
    config, path = case(tmp_path)
    with pytest.raises(InputError) as caught:
        load(config, path, FLEET)
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith(f"{path}: ")


# Standing


def places(target: StandingTarget, ticks: int, begin_at: int | None = None) -> list[tuple[int, np.ndarray]]:
    codec = Codec()
    out = []
    for k in range(ticks):
        now = START + k * TICK
        if k == begin_at:
            target.begin(now)
        for datagram in target.step(now, []):
            for message in codec.feed(datagram.data):
                assert isinstance(message, GlobalPosition)
                assert message.source.system == TARGET_SYSTEM
                assert message.velocity_ned == (0.0, 0.0, 0.0)
                place = FLEET.to_enu(message.latitude, message.longitude, message.altitude)
                out.append((k * TICK, place))
    return out


@pytest.mark.parametrize("rate", [1.0, 5.0, 20.0])
def test_a_standing_target_says_where_it_is_at_its_rate(rate: float) -> None:
    target = StandingTarget(FixedTarget(kind="fixed", at=(3.0, -4.0, 1.0), rate_hz=rate), FLEET)
    said = places(target, 400)
    assert [time for time, _ in said] == [round(k * 1e6 / rate) for k in range(len(said))]
    assert len(said) == round(4.0 * rate)
    assert all(np.allclose(place, (3.0, -4.0, 1.0), atol=0.02) for _, place in said)


def test_it_jumps_at_the_goal_event_and_says_so_at_once() -> None:
    config = FixedTarget(kind="fixed", at=(-8.0, 0.0, 0.0), jump_to=(8.0, 0.0, 0.0))
    target = StandingTarget(config, FLEET)
    said = places(target, 100, begin_at=33)
    west = [time for time, place in said if place[0] < 0.0]
    east = [time for time, place in said if place[0] > 0.0]
    assert max(west) < 33 * TICK == min(east)
    assert np.diff(east).tolist() == [200_000] * (len(east) - 1)
    there = target.position(START)
    assert there is not None
    assert np.array_equal(there, (8.0, 0.0, 0.0))


def test_without_a_jump_the_goal_event_changes_nothing() -> None:
    config = FixedTarget(kind="fixed", at=(1.0, 2.0, 3.0))
    same = [places(StandingTarget(config, FLEET), 100, begin_at=begin) for begin in (None, 33)]
    assert [time for time, _ in same[0]] == [time for time, _ in same[1]]
    assert all(np.array_equal(a[1], b[1]) for a, b in zip(*same, strict=True))
