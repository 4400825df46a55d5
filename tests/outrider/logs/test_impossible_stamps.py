"""Logs with time stamps that are no times, 2⁶³ µs and more: every command that reads logs says so in a line,
and uses the rest."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from mavlink_bridge.tlog.log import read_tlog
from tests.outrider.said import Ended, Run

PIECE = Path(__file__).resolve().parents[2] / "data" / "logs" / "copter-whole.tlog"
IMPOSSIBLE = [1 << 63, (1 << 64) - 1]
COMMANDS = {
    "replay": ("replay", "a.tlog", "--own", "9", "--json", "--out", "said"),
    "fly": (
        *("fly", "--autopilot", "tlog:a.tlog", "--config", "ardupilot", "--system", "9"),
        *("--dry-run", "--json", "--out", "said"),
    ),
    "export": ("export", "a.tlog", "--format", "csv", "--json", "--out", "said"),
}


def left_behind(folder: Path, damaged: set[int]) -> int:
    """Write ``a.tlog``, in which the records ``damaged`` have no possible time; return its records."""
    records = list(read_tlog(PIECE))
    data = b""
    for k, record in enumerate(records):
        stamp = IMPOSSIBLE[k % 2] if k in damaged else record.time | record.link
        data += stamp.to_bytes(8, "big") + record.frame
    (folder / "a.tlog").write_bytes(data)
    return len(records)


def used(name: str, ended: Ended, damaged: int) -> int:
    """The messages that a command used of a log with so many ``damaged`` records, which it names."""
    found = json.loads(ended.out)
    assert (ended.status, found["damaged_records"]) == (0, damaged)
    if name == "export":
        messages = found["messages"]
        assert isinstance(messages, int)
        return messages
    lines = [line for line in ended.err.splitlines() if "damaged" in line]
    assert len(lines) == (damaged > 0)
    for line in lines:
        assert line.startswith(f"a.tlog: damaged at {damaged} places (")
        assert "the rest" not in line
    assert found["finite"]
    records = found["records"]
    assert isinstance(records, int)
    return records


@pytest.mark.parametrize("name", COMMANDS)
def test_stamps_at_the_beginning_and_one_in_ten_cost_nothing_but_themselves(
    name: str, run: Run, tmp_path: Path
) -> None:
    damaged = {*range(20), *range(25, 1000, 10)}
    count = left_behind(tmp_path, damaged)
    ended = run(*COMMANDS[name])
    assert used(name, ended, len([k for k in damaged if k < count])) == count
    if name != "export":
        assert json.loads(ended.out)["setpoints"] > 20


def test_a_log_of_such_stamps_alone_is_exported_at_the_time_0(run: Run, tmp_path: Path) -> None:
    count = left_behind(tmp_path, set(range(1000)))
    assert used("export", run(*COMMANDS["export"]), count) == count
    times = [
        line.split(",", 1)[0]
        for path in (tmp_path / "said").rglob("*.csv")
        for line in path.read_text(encoding="utf-8").splitlines()[1:]
    ]
    assert times == ["1970-01-01 00:00:00.000000Z"] * count
