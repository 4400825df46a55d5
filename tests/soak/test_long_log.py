"""A gigabyte of log in bounded memory: recorded flights one after another, again and again, damage and
all."""

from __future__ import annotations

import gzip
import json
import subprocess
import sys
from pathlib import Path

import pytest

from mavlink_bridge.tlog.log import read_tlog
from tests.mavlink_bridge.recorded_logs import PIECES

GIGABYTE = 1_000_000_000
MOST = 300 << 20
"""Bytes that the whole process may take, the interpreter and all libraries included."""
LISTING = """
import resource, sys
from outrider.__main__ import main
sys.argv = ["outrider", "replay", sys.argv[1], "--list", "--json"]
try:
    main()
finally:
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    sys.stderr.write(str(most if sys.platform == "darwin" else 1024 * most))
"""


def flights() -> tuple[bytes, int]:
    """Some megabytes of whole records, and how many are good."""
    whole = [path for path in PIECES if not count_of(path)[1]]
    times = 5_000_000 // sum(path.stat().st_size for path in whole)
    data = b"".join(path.read_bytes() for path in whole) * times
    return data, times * sum(count_of(path)[0] for path in whole)


def count_of(path: Path) -> tuple[int, bool]:
    """Good records, and whether it ends within one."""
    log = read_tlog(path)
    good = sum(1 for _ in log)
    return good, log.report.truncated


@pytest.mark.soak
@pytest.mark.parametrize("name", ["long.tlog", "long.tlog.gz"])
def test_a_gigabyte_is_listed_in_bounded_memory(name: str, tmp_path: Path) -> None:
    data, good = flights()
    path = tmp_path / name
    piece = data
    if name.endswith(".gz"):
        # What is compressed piece by piece unpacks as one.
        piece = gzip.compress(data, 1)
    times = GIGABYTE // len(data) + 1
    try:
        with path.open("wb") as log:
            for _ in range(times):
                log.write(piece)
        ended = subprocess.run(
            [sys.executable, "-c", LISTING, str(path)], capture_output=True, text=True, check=True
        )
    finally:
        path.unlink(missing_ok=True)
    said = json.loads(ended.stdout)
    assert said["good"] == times * good
    assert said["truncated"] is False
    assert int(ended.stderr) < MOST
