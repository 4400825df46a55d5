"""``outrider export`` as a script sees it: what it makes, what it refuses, what it leaves behind."""

from __future__ import annotations

import gzip
import json
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader

from outrider.errors import InputError
from outrider.export import mcap_export
from outrider.export.command import Result, show
from outrider.export.command import export as exporting
from outrider.export.place import FORMATS
from tests.outrider.export.runs import Ended, Export

LOG = Path(__file__).parents[3] / "config" / "logs" / "escort-target.tlog"


@pytest.fixture
def spoilt(run: Path, tmp_path: Path) -> Path:
    """A copy that may be spoilt."""
    return Path(shutil.copytree(run, tmp_path / "run"))


def refused(ended: Ended, *words: str) -> None:
    assert ended.status == 2
    assert ended.out == ""
    assert ended.err.count("\n") == 1
    for word in (*words, "allowed"):
        assert word in ended.err


@pytest.mark.parametrize("form", FORMATS)
def test_by_default_it_lies_in_the_run_directory(spoilt: Path, export: Export, form: str) -> None:
    before = {path: path.read_bytes() for path in spoilt.rglob("*") if path.is_file()}
    ended = export(spoilt, "--format", form, "--json")
    assert (ended.status, ended.err, ended.out.count("\n")) == (0, "", 1)
    said = json.loads(ended.out)
    place = spoilt / ("flight.mcap" if form == "mcap" else form)
    assert said["out"] == str(place)
    files = [path for path in spoilt.rglob("*") if path.is_file() and path not in before]
    assert (len(files), sum(path.stat().st_size for path in files)) == (said["files"], said["bytes"])
    beside = spoilt / "flight.foxglove.json" if form == "mcap" else place
    assert all(path in (place, beside) or place in path.parents for path in files)
    assert {path: path.read_bytes() for path in before} == before
    assert said["messages"] > 1000
    assert (said["damaged_records"], said["unread_logs"]) == (0, [])
    refused(export(spoilt, "--format", form), str(place), "exists")


def test_a_log_becomes_a_file_beside_it(tmp_path: Path, export: Export) -> None:
    log = tmp_path / "target.tlog.gz"
    log.write_bytes(gzip.compress(LOG.read_bytes()))
    ended = export(log, "--format", "mcap")
    assert (ended.status, ended.err) == (0, "")
    with (tmp_path / "target.mcap").open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    topics = {channel.topic for channel in summary.channels.values()}
    assert topics == {"/mavlink/1/1/GLOBAL_POSITION_INT", "/fix/1"}
    assert export(log, "--format", "csv").status == 0
    assert [path.name for path in (tmp_path / "target-csv").rglob("*.csv")] == ["GLOBAL_POSITION_INT.csv"]


def test_for_people_it_is_a_table_below_the_path_however_long_that_is(
    capsys: pytest.CaptureFixture[str],
) -> None:
    for length in range(1, 200):
        show(Result("csv", "a" * length, 7, 1_500_000, 5, 12345, 0, 0, 0, ()))
        lines = capsys.readouterr().out.splitlines()
        assert lines[0] == "a" * length
        assert any("messages or rows" in line and "12345" in line for line in lines)


def test_bad_words_are_refused_in_one_line(tmp_path: Path, spoilt: Path, export: Export) -> None:
    refused(export(spoilt, "--format", "mcpa"), "mcpa", "csv", "parquet", "ulog", "did you mean 'mcap'")
    refused(export(tmp_path / "nowhere", "--format", "csv"), "nowhere", "no such file")
    refused(export(tmp_path, "--format", "csv"), "configuration.yaml", "not a run directory")
    refused(export(spoilt / "summary.json", "--format", "csv"), "summary.json", "no MAVLink")
    taken = tmp_path / "taken"
    taken.write_text("mine")
    for form in FORMATS:
        refused(export(spoilt, "--format", form, "--out", taken), "taken", "exists", "nothing is overwritten")
    assert taken.read_text() == "mine"
    assert export(spoilt).status == 2
    below = export(spoilt, "--format", "csv", "--out", taken / "below")
    assert (below.status, below.err.count("\n")) == (2, 1)


def test_a_log_without_a_vehicle_makes_no_ulog(tmp_path: Path, export: Export) -> None:
    shutil.copy(LOG, tmp_path / "target.tlog")
    ended = export(tmp_path / "target.tlog", "--format", "ulog")
    assert (ended.status, ended.err.count("\n")) == (2, 1)
    assert "no HEARTBEAT of an autopilot" in ended.err
    assert [path.name for path in tmp_path.iterdir()] == ["target.tlog"]


def test_a_run_that_was_stopped_gives_its_logs(spoilt: Path, export: Export) -> None:
    for name in ("flight.npz", "plans.npz", "plan_times.npz", "summary.json"):
        (spoilt / name).unlink()
    (spoilt / "vehicle-12.tlog").write_bytes(b"\0\1\2\3" * 100)
    said = json.loads(export(spoilt, "--format", "mcap", "--json").out)
    assert said["messages"] > 500
    (unread,) = said["unread_logs"]
    assert "vehicle-12.tlog" in unread
    for log in spoilt.glob("*.tlog"):
        log.unlink()
    refused(export(spoilt, "--format", "csv"), "vehicle-N.tlog")


def test_arrays_that_are_none_of_ours_are_refused(spoilt: Path, export: Export) -> None:
    flight = spoilt / "flight.npz"
    whole = flight.read_bytes()
    with np.load(flight) as file:
        arrays = dict(file)
    wrong = [
        {"yaw": arrays["yaw"][1:]},
        {"position": arrays["position"].astype("U4")},
        {"time_s": arrays["time_s"] * np.nan},
        {"time_s": arrays["time_s"] + 1e12},
        {"start_us": np.zeros(2)},
    ]
    for change in wrong:
        np.savez(flight, **{**arrays, **change})
        ended = export(spoilt, "--format", "mcap")
        assert (ended.status, ended.err.count("\n")) == (2, 1)
        assert "flight.npz" in ended.err
    del arrays["start_us"]
    np.savez(flight, **arrays)
    refused(export(spoilt, "--format", "mcap"), "flight.npz", "start_us", "this version")
    for data in (b"", b"PK\3\4 nothing", whole[: len(whole) // 2]):
        flight.write_bytes(data)
        refused(export(spoilt, "--format", "mcap"), "flight.npz", "cannot be read")
    assert not (spoilt / "flight.mcap").exists()


def test_what_fails_leaves_nothing_behind(
    spoilt: Path,
    export: Export,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    before = set(spoilt.rglob("*"))
    monkeypatch.setattr(mcap_export.McapFile, "write", full)
    ended = export(spoilt, "--format", "mcap")
    assert ended.status == 3
    assert "No space left" in ended.err
    assert set(spoilt.rglob("*")) == before


@pytest.mark.parametrize(("form", "package"), [("mcap", "mcap"), ("csv", "pyarrow"), ("parquet", "pyarrow")])
def test_without_the_extra_it_says_what_to_install(
    spoilt: Path,
    export: Export,
    monkeypatch: pytest.MonkeyPatch,
    form: str,
    package: str,
) -> None:
    for name in [*sys.modules]:
        if name.startswith("outrider.export") or name.partition(".")[0] == package:
            monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, package, None)
    ended = export(spoilt, "--format", form)
    assert (ended.status, ended.err.count("\n")) == (3, 1)
    assert f"needs {package}" in ended.err
    assert "pip install '.[export]'" in ended.err


@settings(max_examples=15, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.lists(st.tuples(st.floats(0.0, 1.0, exclude_max=True), st.binary(max_size=40)), max_size=12),
    st.floats(0.0, 1.0),
    st.sampled_from(FORMATS),
)
def test_whatever_a_log_is_it_is_exported_or_refused(
    run: Path,
    tmp_path: Path,
    edits: list[tuple[float, bytes]],
    kept: float,
    form: str,
) -> None:
    whole = (run / "vehicle-11.tlog").read_bytes()[:30_000]
    data = bytearray(whole[: round(kept * len(whole))])
    for at, junk in edits:
        place = int(at * len(data))
        data[place : place + len(junk)] = junk
    (tmp_path / "log.tlog").write_bytes(bytes(data))
    out = tmp_path / "out"
    try:
        exporting(tmp_path / "log.tlog", form, out, as_json=True)
    except InputError as error:
        assert "\n" not in str(error)  # noqa: PT017
        assert not out.exists()
    else:
        shutil.rmtree(out) if out.is_dir() else out.unlink()
