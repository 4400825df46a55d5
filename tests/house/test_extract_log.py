"""What ``tools/extract_log.py`` cuts out of a log is in it, byte for byte."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from mavlink_bridge.tlog.log import Record, read_tlog

ROOT = Path(__file__).parents[2]
FLIGHTS = ROOT / "tests" / "data" / "flights"
SOURCE = FLIGHTS / "copter-pvy.tlog.gz"
WHOLE = ROOT.parent / "shared" / "tlogs"
HEARTBEAT, LOCAL_POSITION = 0, 32

CUT = (
    *("HEARTBEAT", "COMMAND_LONG", "COMMAND_ACK", "SET_POSITION_TARGET_LOCAL_NED", "EXTENDED_SYS_STATE"),
    *("STATUSTEXT", "LOCAL_POSITION_NED/5", "ATTITUDE/10"),
)
FROM = {
    "copter-full": ("ap_copter463_guided_full", "9", "255"),
    "copter-pvy": ("ap_copter463_guided_pvy", "1", "255"),
    "px4-pvay": ("px4_1161_offboard_pvay", "1"),
}


def extract(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, ROOT / "tools" / "extract_log.py", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def wanted(*names: str) -> list[str]:
    return [word for name in names for word in ("--message", name)]


def message_id(record: Record) -> int:
    return int.from_bytes(record.frame[7:10], "little")


def test_messages_parts_of_messages_and_vehicles(tmp_path: Path) -> None:
    records = list(read_tlog(SOURCE))
    ours = [record for record in records if record.frame[5] == 1]
    done = extract(SOURCE, tmp_path / "cut.tlog", *wanted("HEARTBEAT", "LOCAL_POSITION_NED/3"))
    assert done.returncode == 0, done.stderr
    places = [record for record in ours if message_id(record) == LOCAL_POSITION][::3]
    kept = [record for record in ours if message_id(record) == HEARTBEAT or record in places]
    assert list(read_tlog(tmp_path / "cut.tlog")) == kept
    assert len(places) > 200

    done = extract(
        *(SOURCE, tmp_path / "both.tlog.gz", *wanted("HEARTBEAT")),
        *("--system", "1", "255", "--start", "10", "--duration", "20"),
    )
    assert done.returncode == 0, done.stderr
    begin = records[0].time
    within = [record for record in records if 10e6 <= record.time - begin < 30e6]
    assert list(read_tlog(tmp_path / "both.tlog.gz")) == [r for r in within if message_id(r) == HEARTBEAT]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--message", "NOTHING"), "NOTHING"),
        (("--message", "HEARTBEAT/0"), "HEARTBEAT/0"),
        (("--message", "HEARTBEAT/x"), "HEARTBEAT/x"),
        (("--message", "HEARTBEAT", "--system", "77"), "holds no such message"),
    ],
)
def test_what_cannot_be_cut_is_said(tmp_path: Path, arguments: tuple[str, ...], said: str) -> None:
    done = extract(SOURCE, tmp_path / "cut.tlog", *arguments)
    assert done.returncode == 2
    assert said in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.slow
@pytest.mark.skipif(not WHOLE.is_dir(), reason="the whole logs do not lie beside the checkout")
@pytest.mark.parametrize("name", FROM)
def test_the_flights_are_cut_out_of_the_whole_logs(tmp_path: Path, name: str) -> None:
    log, *systems = FROM[name]
    done = extract(WHOLE / f"{log}.tlog", tmp_path / "cut.tlog", *wanted(*CUT), "--system", *systems)
    assert done.returncode == 0, done.stderr
    assert list(read_tlog(tmp_path / "cut.tlog")) == list(read_tlog(FLIGHTS / f"{name}.tlog.gz"))
