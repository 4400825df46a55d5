"""``outrider replay LOG --list``: everyone who is in a log and nobody else, and what could not be read."""

from __future__ import annotations

import gzip
import json
import os
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import Heartbeat, Source, StatusText
from mavlink_bridge.tlog.log import TlogWriter, read_tlog
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.framing import Frame, frame_at
from outrider.__main__ import main
from outrider.logs.census import Census
from outrider.logs.listing import document
from outrider.logs.tables import show
from outrider.logs.tally import SHORTEST_GAP, UNUSUAL, count
from tests.mavlink_bridge.recorded_logs import LOGS, PIECES, SHIPPED

NOW = 1_700_000_000_000_000
KEYS = {
    "vehicles",
    "good",
    "bad",
    "skipped",
    "unknown",
    "truncated",
    "time_steps_back",
    "start",
    "end",
    "duration_s",
    "signed",
    "signed_messages",
}


class Ended(NamedTuple):
    status: int
    out: str
    err: str


List = Callable[..., Ended]


@pytest.fixture
def listed(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> List:
    """The command as a script sees it."""

    def call(path: Path, *options: str) -> Ended:
        monkeypatch.setattr(sys, "argv", ["outrider", "replay", str(path), "--list", *options])
        monkeypatch.setenv("COLUMNS", "140")
        with pytest.raises(SystemExit) as ended:
            main()
        code = ended.value.code
        assert isinstance(code, int)
        return Ended(code, *capsys.readouterr())

    return call


def census(path: Path) -> Census:
    found = count(path, lambda _share: None)
    assert found is not None
    return found


def beats(times: Sequence[int], system: int = 11, component: int = 1) -> list[tuple[int, bytes]]:
    codec = Codec()
    return [(time, codec.encode(Heartbeat(Source(system, component), 2, 3, 81, 4, 4))) for time in times]


def written(path: Path, sent: list[tuple[int, bytes]]) -> Path:
    with TlogWriter(path) as log:
        for time, data in sent:
            log.write(time, 0, data)
    return path


@pytest.mark.parametrize("path", LOGS)
def test_it_is_what_pymavlink_decodes(path: Path, listed: List) -> None:
    """Who said what how often, types and autopilots, first and last time."""
    ended = listed(path, "--json")
    assert (ended.status, ended.err, ended.out.count("\n")) == (0, "", 1)
    said = json.loads(ended.out)
    assert set(said) == KEYS
    names: dict[int, Counter[str]] = {}
    components: dict[int, set[int]] = {}
    kinds: dict[int, tuple[int, int]] = {}
    times: dict[int, list[int]] = {}
    parser = mavlink.MAVLink(None)
    log = read_tlog(path)
    for record in log:
        message = parser.decode(bytearray(record.frame))
        system = message.get_srcSystem()
        names.setdefault(system, Counter())[message.get_type()] += 1
        components.setdefault(system, set()).add(message.get_srcComponent())
        times.setdefault(system, []).append(record.time)
        # MAV_AUTOPILOT_INVALID: no autopilot, but a camera, or a ground station.
        if message.get_type() == "HEARTBEAT" and (message.autopilot != 8 or system not in kinds):
            kinds[system] = message.type, message.autopilot
    report = log.report
    assert (said["good"], said["bad"], said["unknown"], said["skipped"]) == report[:4]
    assert said["good"] == sum(vehicle["messages"] for vehicle in said["vehicles"])
    assert [vehicle["system_id"] for vehicle in said["vehicles"]] == sorted(names)
    enums = mavlink.enums
    for vehicle in said["vehicles"]:
        system = vehicle["system_id"]
        assert vehicle["components"] == sorted(components[system])
        if system in kinds:
            assert vehicle["type"] == enums["MAV_TYPE"][kinds[system][0]].name
            assert vehicle["autopilot"] == enums["MAV_AUTOPILOT"][kinds[system][1]].name
        else:
            assert (vehicle["type"], vehicle["autopilot"]) == (None, None)
        first, last = min(times[system]) / 1e6, max(times[system]) / 1e6
        assert (vehicle["start"], vehicle["end"]) == (first, last)
        assert vehicle["messages"] == names[system].total()
        assert vehicle["rate_hz"] == {
            name: pytest.approx(number / (last - first), rel=1e-3) for name, number in names[system].items()
        }
    everything = sorted(time for some in times.values() for time in some)
    assert (said["start"], said["end"]) == (everything[0] / 1e6, everything[-1] / 1e6)
    assert said["duration_s"] == pytest.approx(said["end"] - said["start"], abs=1e-5)
    assert said["signed"] is False


@pytest.mark.parametrize("path", PIECES, ids=lambda path: path.stem)
def test_compressed_it_is_the_same(path: Path, listed: List, tmp_path: Path) -> None:
    packed = tmp_path / "log.tlog.gz"
    packed.write_bytes(gzip.compress(path.read_bytes()))
    assert listed(packed, "--json") == listed(path, "--json")


def test_two_logs_in_one_are_the_sum_of_both(tmp_path: Path) -> None:
    whole = [path for path in (SHIPPED, *PIECES) if not census(path).report.truncated]
    one, other = census(whole[0]), census(whole[-1])
    both = tmp_path / "both.tlog"
    both.write_bytes(whole[0].read_bytes() + whole[-1].read_bytes())
    together = census(both)
    assert together.report[:4] == tuple(a + b for a, b in zip(one.report[:4], other.report[:4], strict=True))
    expected: Counter[tuple[int, int]] = Counter()
    for part in (one, other):
        for vehicle in part.vehicles:
            expected.update({(vehicle.system, number): many for number, many in vehicle.counts})
    found = {(v.system, number): many for v in together.vehicles for number, many in v.counts}
    assert found == expected
    assert (together.start, together.end) == (min(one.start, other.start), max(one.end, other.end))


def test_the_progress_goes_up_to_the_end() -> None:
    shares: list[float] = []
    count(PIECES[0], shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


# Gaps


@given(st.integers(1_000, 60_000_000), st.integers(2, 200))
def test_who_speaks_evenly_has_no_gap(interval: int, number: int) -> None:
    with TemporaryDirectory() as folder:
        path = written(Path(folder) / "a.tlog", beats(range(NOW, NOW + number * interval, interval)))
        (vehicle,) = census(path).vehicles
    assert vehicle.gaps[1:] == (0, 0)
    assert vehicle.gaps.limit >= SHORTEST_GAP


@given(st.integers(1_000, 3_000_000), st.integers(100, 200), st.integers(0, 98), st.floats(1.0, 20.0))
def test_a_silence_is_found_with_its_length(interval: int, number: int, at: int, much: float) -> None:
    """One that is more than twice as long as what is a gap for sure."""
    silence = int(much * (2 * UNUSUAL * 2 * interval + 2 * SHORTEST_GAP)) & ~3
    interval &= ~3
    times = [NOW + k * interval + (silence if k > at else 0) for k in range(number)]
    with TemporaryDirectory() as folder:
        path = written(Path(folder) / "a.tlog", beats(times) + beats([NOW, times[-1]], system=12))
        one, other = census(path).vehicles
    assert one.gaps[1:] == (1, silence + interval)
    # Who speaks twice has nothing but his usual interval.
    assert other.gaps.number == 0


def test_time_that_steps_back_is_no_gap_and_is_counted(tmp_path: Path) -> None:
    times = [NOW + 1_000_000 * k for k in (0, 1, 2, -50, -49, -48)]
    found = census(written(tmp_path / "a.tlog", beats(times)))
    assert found.report.time_steps_back == 1
    assert (found.start, found.end) == (min(times), max(times))
    assert found.vehicles[0].gaps.number == 0


# What else there is to tell


def test_versions_links_signatures_and_odd_systems(tmp_path: Path) -> None:
    codec = Codec()
    plain = Heartbeat(Source(0, 1), 2, 3, 81, 4, 4)
    signed = frame_at(codec.encode(StatusText(Source(11, 1), 6, "hello")), 0)
    assert isinstance(signed, Frame)
    body = signed.data[:2] + b"\1" + signed.data[3:-2]
    checksum = mavlink.x25crc(body[1:] + bytes([mavlink.MAVLink_statustext_message.crc_extra]))
    path = tmp_path / "a.tlog"
    with TlogWriter(path) as log:
        log.write(NOW, 0, codec.encode_v1(plain))
        log.write(NOW, 3, codec.encode(plain))
        log.write(NOW, 1, codec.encode(Heartbeat(Source(11, 9), 250, 251, 0, 0, 0)))
    with path.open("ab") as others:
        # Ours takes signatures off; other programs keep them.
        others.write((NOW + 1).to_bytes(8, "big") + body + checksum.crc.to_bytes(2, "little") + bytes(13))
    said = document(census(path))
    nobody, other = said["vehicles"]
    assert (nobody["system_id"], nobody["versions"], nobody["links"]) == (0, [1, 2], [0, 3])
    assert (other["versions"], other["links"], other["signed_messages"]) == ([2], [1], 1)
    assert (other["type"], other["autopilot"]) == ("MAV_TYPE_250", "MAV_AUTOPILOT_251")
    assert (said["signed"], said["signed_messages"]) == (True, 1)
    # In a log of one instant nothing has a rate.
    assert said["duration_s"] == 0.0
    assert set(other["rate_hz"].values()) == {0.0}


def test_the_autopilot_speaks_for_its_components(tmp_path: Path) -> None:
    codec = Codec()
    camera = codec.encode(Heartbeat(Source(1, 100), 30, 8, 0, 0, 4))
    pilot = codec.encode(Heartbeat(Source(1, 200), 13, 12, 0, 0, 4))
    for order in ([camera, pilot], [pilot, camera]):
        path = written(tmp_path / "a.tlog", [(NOW, frame) for frame in order])
        (vehicle,) = census(path).vehicles
        assert (vehicle.kind, vehicle.autopilot) == (13, 12)


# For people


def test_for_people_it_is_tables(listed: List) -> None:
    path = next(path for path in PIECES if path.stem == "quadrotor-damaged")
    ended = listed(path)
    assert (ended.status, ended.err) == (0, "")
    for word in (path.name, "2015-07-05", "700", "205", "4324", "gcs", "no heartbeat", "RADIO_STATUS"):
        assert word in ended.out


@pytest.mark.parametrize("name", ["[red].tlog", "[bold x.tlog", "a b.tlog", "[link=x]y.gz"])
def test_any_name_will_do(name: str, listed: List, tmp_path: Path) -> None:
    path = written(tmp_path / name, beats([NOW]))
    ended = listed(path)
    assert (ended.status, ended.err) == (0, "")
    assert name in ended.out


def test_a_name_is_whole_however_long_it_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = census(written(tmp_path / "a.tlog", beats([NOW])))
    for length in range(1, 200):
        show("a" * length, found)
        assert capsys.readouterr().out.startswith("a" * length + "\n")


def test_a_crowd_fits_into_the_tables(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    sent = [beat for system in range(256) for beat in beats([NOW, NOW + 1_000_000], system)]
    show("crowd", census(written(tmp_path / "a.tlog", sent)))
    assert "rarer systems" in capsys.readouterr().out


def test_times_of_no_calendar_are_told(tmp_path: Path, listed: List) -> None:
    path = written(tmp_path / "a.tlog", beats([2**62, 2**63 - 4]))
    assert str(2**62) in listed(path).out
    assert json.loads(listed(path, "--json").out)["start"] == 2**62 / 1e6


# Bad input


@pytest.mark.parametrize(
    ("content", "words"),
    [(b"", "no MAVLink"), (b"hello\n" * 99, "no MAVLink"), (SHIPPED.read_bytes()[:20], "no MAVLink")],
    ids=["empty", "text", "cut within the first record"],
)
def test_what_is_no_log(content: bytes, words: str, listed: List, tmp_path: Path) -> None:
    path = tmp_path / "a.tlog"
    path.write_bytes(content)
    refused(listed(path), str(path), words)
    refused(listed(path, "--json"), str(path), words)


def test_what_is_no_file(listed: List, tmp_path: Path) -> None:
    refused(listed(tmp_path), str(tmp_path), "is a directory")
    refused(listed(tmp_path / "none.tlog"), "none.tlog", "no such file")
    refused(listed(tmp_path / ("a" * 300)), "cannot be read")
    refused(listed(tmp_path, "--certify"), "allowed: one of --list, --certify")
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    refused(listed(pipe), "not a file")


def refused(ended: Ended, *words: str) -> None:
    assert (ended.status, ended.out, ended.err.count("\n")) == (2, "", 1)
    for word in (*words, "allowed"):
        assert word in ended.err
