"""A log drives a companion: what it would have sent, and what goes to a live link."""

from __future__ import annotations

import csv
import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.config import CompanionConfig
from mavlink_bridge.clocks.clock import SimulatedClock
from mavlink_bridge.errors import LogError
from mavlink_bridge.key import Key
from mavlink_bridge.links.link import memory_pair
from mavlink_bridge.messages import CommandLong, GlobalPosition, Heartbeat, SetpointLocal, Source
from mavlink_bridge.tlog.log import Record, TlogWriter, read_tlog
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.signing import Signing
from outrider.logs.timeline import on_one_line
from outrider.replay.telemetry import TELEMETRY, Forwarder, paced
from outrider.shadow.roles import Part, Roles, survey
from outrider.shadow.setpoints import facts
from outrider.shadow.shadow_run import STEP, shadow_flight, steps
from outrider.simulation.preparation import Prepared
from outrider.swarm import command as swarm
from tests.outrider.said import Run
from tests.outrider.shipped import FIREFLY, LOGS, scenario

SHARED = Path(__file__).resolve().parents[4] / "shared" / "tlogs"
REAL = [("ap_copter463_guided_full", 9), ("ap_copter463_guided_pvy", 1), ("px4_1161_offboard_pvay", 1)]


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One vehicle's log of a flight of two, from the ground to the ground."""
    directory = tmp_path_factory.mktemp("flown") / "run"
    directory.mkdir()
    of = scenario("antipodal-8", vehicles=2, cap_s=4.0, companion={"rates": {"replan_us": 50_000}})
    swarm.fly(Prepared(of, FIREFLY), 1, directory, lambda _stage, _seconds: None)
    return directory / "vehicle-11.tlog"


def continuous(told: list[tuple[int, SetpointLocal]], config: CompanionConfig) -> None:
    """Finite, without steps, within the limits; one every 20 ms."""
    found = facts(told)
    speed, a_total = float(np.linalg.norm(config.limits.v_max)), config.limits.a_total
    assert found.setpoints > 100
    assert found.finite
    assert (found.max_speed_m_s or 0.0) <= speed
    assert (found.max_acceleration_m_s2 or 0.0) <= a_total + 1e-3
    # As far as the vehicle flew meanwhile, and what its estimate was corrected by.
    assert (found.max_step_m or 0.0) <= 0.02 * speed + 0.15
    assert set(found.mask_counts) == {"0x000"}
    assert set(found.frames) == {"1"}


def test_a_companion_listens_to_a_flight_of_others(log: Path, run: Run, tmp_path: Path) -> None:
    ended = run("replay", str(log), "--own", "11", "--like", "antipodal", "--out", "said", "--json")
    assert (ended.status, ended.err) == (0, "")
    said = json.loads(ended.out)
    assert said["finite"] is True
    assert said["setpoints"] > 300
    assert said["sent"]["setpoints"] > 200
    assert said["max_step_m"] < 0.3
    assert sorted(path.name for path in (tmp_path / "said").iterdir()) == [
        "replay.json",
        "replay.png",
        "setpoints.csv",
    ]
    assert json.loads((tmp_path / "said" / "replay.json").read_text()) == said
    with (tmp_path / "said" / "setpoints.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len([row for row in rows if row["who"] == "would"]) == said["setpoints"]
    assert len([row for row in rows if row["who"] == "sent"]) == said["sent"]["setpoints"]


def test_the_same_log_gives_the_same_set_points(log: Path) -> None:
    config, cast = CompanionConfig(), Roles(11)
    seen = survey(read_tlog(log), 11, "log")
    once, again = (shadow_flight(config, cast, seen, read_tlog(log)) for _ in range(2))
    assert once == again
    continuous(once.would, config)


@pytest.mark.slow
def test_what_a_log_lacks_is_put_in(log: Path, tmp_path: Path) -> None:
    """Without GPS_GLOBAL_ORIGIN, or without LOCAL_POSITION_NED, nearly the same is said."""
    config, cast = CompanionConfig(), Roles(11)
    whole = shadow_flight(config, cast, survey(read_tlog(log), 11, "log"), read_tlog(log))
    for missing in ({49}, {32, 49}):
        path = tmp_path / f"without-{len(missing)}.tlog"
        with TlogWriter(path) as writer:
            for record in read_tlog(log):
                if record.frame[7] not in missing:
                    writer.write(record.time | record.link, record.link, record.frame)
        seen = survey(read_tlog(path), 11, "log")
        assert seen.local == (32 not in missing)
        found = shadow_flight(config, cast, seen, read_tlog(path))
        assert facts(found.would).finite
        assert len(found.would) > 0.5 * len(whole.would)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "own"), REAL)
def test_logs_of_real_autopilots_give_sound_set_points(name: str, own: int) -> None:
    path = SHARED / f"{name}.tlog"
    if not path.exists():
        pytest.skip("the shared logs are not beside this checkout")
    config = CompanionConfig()
    found = shadow_flight(config, Roles(own), survey(read_tlog(path), own, name), read_tlog(path))
    continuous(found.would, config)
    assert len(found.sent) >= 2000


def test_a_vehicle_of_ours_escorts_what_was_recorded(run: Run, tmp_path: Path) -> None:
    """The shipped piece of a real flight as the target, shortened."""
    records = list(read_tlog(LOGS / "escort-target.tlog"))
    begin = records[0].time
    with TlogWriter(tmp_path / "piece.tlog") as writer:
        for record in records:
            if record.time - begin < 12_000_000:
                writer.write(record.time | record.link, record.link, record.frame)
    ended = run("replay", "piece.tlog", "--target", "1", "--out", "said", "--json")
    assert (ended.status, ended.err) == (0, "")
    said = json.loads(ended.out)
    config = scenario("escort").companion
    assert said["finite"] is True
    assert said["setpoints"] > 500
    assert said["max_speed_m_s"] <= np.linalg.norm(config.limits.v_max)
    assert said["max_acceleration_m_s2"] <= config.limits.a_total + 1e-3
    assert said["max_step_m"] <= 0.02 * np.linalg.norm(config.limits.v_max) + 0.01
    assert (tmp_path / "said" / "vehicle-11.tlog").exists()


times = st.lists(st.integers(0, 60_000_000), max_size=60)


@given(times)
def test_time_goes_on_by_steps_and_every_record_comes_once(stamps: list[int]) -> None:
    records = [Record(stamp - stamp % 4, 0, bytes([k])) for k, stamp in enumerate(stamps)]
    given_ = list(steps(records))
    assert [record.frame for _, batch in given_ for record in batch] == [record.frame for record in records]
    assert all(now > before for (before, _), (now, _) in pairwise(given_))
    for now, batch in given_:
        # Nobody hears of what is yet to come; and what is late comes at once.
        assert all(record.time <= now for record in batch)
    # Only long silence is skipped.
    assert all(now - before == STEP or now - before > 4_900_000 for (before, _), (now, _) in pairwise(given_))


def frames() -> list[bytes]:
    """What a vehicle says, what a ground station asks for."""
    codec = Codec()
    vehicle, ground = Source(7, 1), Source(255, 190)
    place = GlobalPosition(vehicle, 1_000_000, 47.0, 8.0, 500.0, 10.0, (0.0, 0.0, 0.0), None)
    zero = (0.0, 0.0, 0.0)
    return [
        codec.encode(message)
        for message in (
            place,
            Heartbeat(vehicle, 2, 3, 0x81, 4, 4),
            Heartbeat(ground, 6, 8, 0, 0, 4),
            place,
            place._replace(source=ground),
            CommandLong(ground, 7, 1, 400, 0, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)),
            CommandLong(vehicle, 1, 1, 400, 0, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)),
            SetpointLocal(vehicle, 0, 7, 1, 1, 0, zero, zero, zero, 0.0, 0.0),
        )
    ]


def test_only_telemetry_of_vehicles_goes_to_a_live_link() -> None:
    near, far = memory_pair()
    forwarder = Forwarder(near)
    given_ = frames()
    for frame in given_:
        forwarder.take(frame)
    # From its first heartbeat on a sender is known to be a vehicle.
    assert far.receive() == [given_[1], given_[3]]
    assert (forwarder.sent, forwarder.kept) == (2, 6)


def test_no_signature_of_a_log_goes_to_a_live_link() -> None:
    """It would be old there, and a help to whoever looks for the key."""
    near, far = memory_pair()
    forwarder, codec = Forwarder(near), Codec(None, Signing(Key(b"k" * 32)))
    beat = Heartbeat(Source(7, 1), 2, 3, 0x81, 4, 4)
    forwarder.take(codec.encode(beat))
    assert far.receive() == [Codec().encode(beat)]


def test_nothing_that_asks_or_orders_is_telemetry() -> None:
    from pymavlink.dialects.v20 import all as mavlink

    names = [mavlink.mavlink_map[identifier].msgname for identifier in TELEMETRY]
    asking = (
        "SET_",
        "COMMAND_",
        "REQUEST",
        "MISSION_ITEM",
        "MISSION_COUNT",
        "PARAM_",
        "MANUAL",
        "RC_",
        "FILE",
    )
    assert not [name for name in names if any(word in name for word in asking) or name.startswith("SET")]


@given(times, st.floats(0.1, 10.0))
@settings(max_examples=30)
def test_records_come_at_their_times(stamps: list[int], speed: float) -> None:
    clock = SimulatedClock(5_000_000)
    first, gone, before = None, 0, 0
    for record in paced([Record(stamp, 0, b"") for stamp in sorted(stamps)], clock, speed):
        first = record.time if first is None else first
        # Long silence is cut short.
        gone += min(record.time - before, 5_000_000) if record.time > first else 0
        before = record.time
        assert clock.now() - 5_000_000 == pytest.approx(gone / speed, abs=len(stamps))


@given(
    st.lists(st.integers(0, 20_000), min_size=4, max_size=60), st.integers(1, 58), st.sampled_from([-3, 3])
)
def test_stamps_that_jump_lose_nothing(gaps: list[int], where: int, hours: int) -> None:
    """A clock that was set in the middle: what comes after follows what came before."""
    times = np.cumsum([0, *gaps]) + 10**15
    where = min(where, len(times) - 2)
    jumped = times.copy()
    jumped[where:] += hours * 24 * 3_600_000_000
    line = [record.time for record in on_one_line(Record(int(t), 0, b"") for t in jumped)]
    assert line == sorted(line)
    assert len(line) == len(times)
    np.testing.assert_allclose(np.diff(line[where:]), np.diff(times[where:]), atol=8)
    assert line[-1] - line[0] <= times[-1] - times[0] + 8


@given(st.integers(0, 40), st.sampled_from([-(10**11), 10**9, 10**14]))
def test_one_wrong_stamp_moves_no_other(where: int, off: int) -> None:
    times = 10**15 + 20_000 * np.arange(42)
    wrong = times.copy()
    wrong[where] += off
    line = [record.time for record in on_one_line(Record(int(t), 0, b"") for t in wrong)]
    others = np.arange(42) != where
    if where > 0:
        np.testing.assert_array_equal(np.array(line)[others], times[others])
    assert line == sorted(line)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ((), "--own ID"),
        (("--own", "99"), "99"),
        (("--own", "11", "--target", "77"), "--target 77"),
        (("--own", "11", "--target", "11"), "own vehicle"),
        (("--own", "11", "--neighbours", "12,x"), "'x'"),
        (("--own", "11", "--neighbours", "12,0"), "'0'"),
        (("--own", "11", "--like", "antipodel"), "antipodal"),
        (("--target", "12", "--speed", "1"), "--speed"),
        (("--to", "nowhere"), "nowhere"),
    ],
)
def test_what_does_not_fit_is_named(options: tuple[str, ...], said: str, log: Path, run: Run) -> None:
    ended = run("replay", str(log), *options)
    assert ended.status in (2, 3)
    assert said in ended.err
    assert ended.err.count("\n") == 1


@given(st.binary(max_size=400))
@settings(max_examples=40)
def test_a_file_of_anything_is_refused_in_a_line(data: bytes) -> None:
    """What is no log has nobody in it."""
    from tempfile import TemporaryDirectory

    from outrider.errors import InputError
    from outrider.replay.request import Request

    with TemporaryDirectory() as folder:
        path = Path(folder) / "noise.tlog"
        path.write_bytes(data)
        with pytest.raises(InputError):
            Request(path, own=1).run()


def test_parts_are_given_by_who_speaks() -> None:
    codec = Codec()
    cast = Roles(7, frozenset({8}), 9)
    parts = {
        system: cast.part(codec.encode(Heartbeat(Source(system, 1), 2, 3, 0, 0, 4)))
        for system in (7, 8, 9, 10)
    }
    assert parts == {7: Part.AUTOPILOT, 8: Part.SWARM, 9: Part.TARGET, 10: Part.NOTHING}
    assert Roles(7).part(codec.encode(Heartbeat(Source(10, 1), 2, 3, 0, 0, 4))) is Part.SWARM


PIECE = Path(__file__).resolve().parents[2] / "data" / "logs" / "copter-whole.tlog"


@given(
    st.lists(st.tuples(st.integers(0, 1 << 30), st.binary(min_size=1, max_size=12)), max_size=30),
    st.integers(0, 1 << 30),
)
@settings(max_examples=25)
def test_a_damaged_log_is_listened_to_all_the_same(damage: list[tuple[int, bytes]], cut: int) -> None:
    """Whatever is left of it: finite set-points within the limits, or a line that says what is missing."""
    from tempfile import TemporaryDirectory

    from outrider.errors import InputError

    data = bytearray(PIECE.read_bytes()[:60_000])
    for at, noise in damage:
        place = at % len(data)
        data[place : place + len(noise)] = noise
    with TemporaryDirectory() as folder:
        path = Path(folder) / "damaged.tlog"
        path.write_bytes(data[: max(cut % len(data), 1)] if damage else data)
        config = CompanionConfig()
        try:
            seen = survey(read_tlog(path), 9, "damaged")
        except (InputError, LogError):
            return
        found = facts(shadow_flight(config, Roles(9), seen, read_tlog(path)).would)
    assert found.finite
    assert (found.max_speed_m_s or 0.0) <= np.linalg.norm(config.limits.v_max)
    assert (found.max_acceleration_m_s2 or 0.0) <= config.limits.a_total + 1e-3


def test_a_log_without_what_planning_needs_ends_with_1_and_says_so(run: Run) -> None:
    """The recorded target's log holds positions only."""
    ended = run("replay", str(LOGS / "escort-target.tlog"), "--own", "1", "--out", "said")
    assert ended.status == 1
    assert "nothing would have been sent: the log lacks a heartbeat of the autopilot" in ended.err
