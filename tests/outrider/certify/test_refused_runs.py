"""What is no run is refused by ``outrider replay --certify``; damaged logs end with a verdict."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from outrider.certify.reading import read
from outrider.certify.verdict import judge
from outrider.errors import InputError
from tests.outrider.certify.runs import Ended, Replay, rewrite


@pytest.fixture(scope="module")
def thin(flown: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same with little but plans in its logs: they can be damaged many times in short time."""
    folder = tmp_path_factory.mktemp("thin") / "run"
    shutil.copytree(flown, folder, ignore=shutil.ignore_patterns("*.png", "*.npz"))
    for log in folder.glob("*.tlog"):
        rewrite(log, lambda tunnel: tunnel, rest=False)
        log.write_bytes(log.read_bytes()[:60_000])
    return folder


def refused(ended: Ended, *words: str) -> None:
    assert ended.status == 2
    assert ended.out == ""
    assert ended.err.count("\n") == 1
    for word in (*words, "allowed"):
        assert word in ended.err


def test_what_is_no_run(tmp_path: Path, flown: Path, run: Path, replay: Replay) -> None:
    refused(replay(tmp_path / "nowhere", "--certify"), "nowhere", "no such directory")
    refused(replay(flown / "configuration.yaml", "--certify"), "configuration.yaml", "not a directory")
    for log in run.glob("*.tlog"):
        log.unlink()
    refused(replay(run, "--certify"), str(run), "vehicle-N.tlog")
    (run / "configuration.yaml").unlink()
    ended = replay(run, "--certify")
    assert (ended.status, ended.err.count("\n")) == (2, 1)
    assert "configuration.yaml: no such file" in ended.err


def test_a_flight_of_the_field_has_nothing_to_certify(run: Path, replay: Replay) -> None:
    path = run / "configuration.yaml"
    text = path.read_text()
    path.write_text(text.replace("avoidance: certified", "avoidance: field"))
    refused(replay(run, "--certify"), "'field'", "--avoidance certified")
    path.write_text(text)
    for log in run.glob("*.tlog"):
        rewrite(log, lambda tunnel: None)
    refused(replay(run, "--certify"), "no plan", "--avoidance certified")


def test_logs_of_garbage_are_refused_and_one_of_them_is_named(run: Path, replay: Replay) -> None:
    logs = sorted(run.glob("*.tlog"))
    logs[0].write_bytes(b"\0\1\2\3" * 1000)
    ended = replay(run, "--certify", "--json")
    assert ended.status == 1
    (finding,) = json.loads(ended.out)["findings"]
    assert (finding["who"], finding["when_s"]) == ([11], 0.0)
    assert "no log" in finding["what"]
    for log in logs:
        log.write_bytes(b"\0\1\2\3" * 1000)
    refused(replay(run, "--certify"), "vehicle-11.tlog", "no MAVLink")


def test_damaged_records_are_counted(run: Path, replay: Replay) -> None:
    log = run / "vehicle-12.tlog"
    data = bytearray(log.read_bytes())
    for at in range(5_000, 105_000, 10_000):
        data[at] ^= 0xFF
    log.write_bytes(bytes(data))
    ended = replay(run, "--certify", "--json")
    assert ended.status in (0, 1)
    assert json.loads(ended.out)["damaged_records"] >= 5


@settings(max_examples=30)
@given(
    st.lists(st.tuples(st.floats(0.0, 1.0, exclude_max=True), st.binary(max_size=40)), max_size=12),
    st.floats(0.0, 1.0),
    st.sampled_from([11, 12, 13]),
)
def test_whatever_becomes_of_a_log_it_ends_with_a_verdict_or_is_refused(
    thin: Path, edits: list[tuple[float, bytes]], kept: float, system: int
) -> None:
    log = thin / f"vehicle-{system}.tlog"
    whole = log.read_bytes()
    data = bytearray(whole[: round(kept * len(whole))] if kept < 0.7 else whole)
    for at, junk in edits:
        place = int(at * len(data))
        data[place : place + len(junk)] = junk
    log.write_bytes(bytes(data))
    try:
        said = json.dumps(judge(read(thin, lambda _what, _share: None)).document())
        assert "NaN" not in said
    except InputError as error:
        assert "\n" not in str(error)  # noqa: PT017
    finally:
        log.write_bytes(whole)
