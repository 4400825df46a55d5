"""The journal: what was written counts, whatever tore its end; what is not its own is refused."""

from __future__ import annotations

import json
import os
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from outrider.errors import InputError, OutriderError
from outrider.sweep.journal import Header, opened
from outrider.sweep.tasks import Entry

HEADER = Header("swap", "0123", {"outrider": "1", "numpy": "2"})
ENTRIES = st.builds(
    Entry,
    key=st.text("abcdef0123456789", min_size=1, max_size=20),
    seed=st.integers(0, 10**9),
    status=st.just("done"),
    what=st.none(),
    summary=st.dictionaries(
        st.text(max_size=10), st.none() | st.booleans() | st.floats(allow_nan=False, allow_infinity=False)
    ),
    wall_s=st.floats(0.0, 1e6),
) | st.builds(
    Entry,
    key=st.text("abcdef0123456789", min_size=1, max_size=20),
    seed=st.integers(0, 10**9),
    status=st.sampled_from(["fault", "lost"]),
    what=st.none() | st.text(max_size=50),
    summary=st.none(),
    wall_s=st.floats(0.0, 1e6),
)


def entry(seed: int) -> Entry:
    return Entry("ab", seed, "done", None, {"converged": True}, 1.5)


def journal_with(folder: Path, entries: list[Entry]) -> Path:
    path = folder / "journal.jsonl"
    with opened(path, HEADER) as journal:
        for one in entries:
            journal.append(one)
    return path


def latest(entries: list[Entry]) -> dict[tuple[str, int], Entry]:
    return {one.run: one for one in entries}


@settings(max_examples=50)
@given(st.lists(ENTRIES, max_size=8))
def test_what_was_written_comes_back(entries: list[Entry]) -> None:
    with TemporaryDirectory() as folder:
        path = journal_with(Path(folder), entries)
        assert len(path.read_bytes().splitlines()) == 1 + len(entries)
        with opened(path, HEADER) as journal:
            assert journal.entries == latest(entries)


@settings(max_examples=50)
@given(st.lists(ENTRIES, min_size=1, max_size=5), st.data())
def test_whatever_a_kill_tears_off_the_whole_lines_count(entries: list[Entry], data: st.DataObject) -> None:
    with TemporaryDirectory() as folder:
        path = journal_with(Path(folder), entries)
        whole = path.read_bytes()
        left = data.draw(st.integers(0, len(whole)), "left")
        # A file system may leave a tail of zeros after a loss of power.
        tail = data.draw(st.sampled_from([b"", b"\0" * 7, b'{"run":']), "tail")
        path.write_bytes(whole[:left] + tail)
        lines = whole[:left].count(b"\n")
        kept = entries[: max(lines - 1, 0)]
        with opened(path, HEADER) as journal:
            assert journal.entries == latest(kept)
            journal.append(entry(7))
        # And it goes on as if nothing had happened.
        with opened(path, HEADER) as journal:
            assert journal.entries == latest([*kept, entry(7)])
        assert path.read_bytes().count(b"\n") == 1 + len(kept) + 1


@settings(max_examples=50)
@given(st.binary(max_size=200))
def test_any_bytes_are_a_journal_or_an_input_error_and_then_left_alone(data: bytes) -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "journal.jsonl"
        path.write_bytes(data)
        try:
            with opened(path, HEADER) as journal:
                assert journal.entries == {}
        except InputError as error:
            said = str(error)
        else:
            return
        assert "\n" not in said
        assert path.read_bytes() == data


@settings(max_examples=50)
@given(st.integers(0, 3), st.binary(min_size=1, max_size=60), st.data())
def test_damage_before_the_end_is_refused_with_its_line(line: int, junk: bytes, data: st.DataObject) -> None:
    with TemporaryDirectory() as folder:
        path = journal_with(Path(folder), [entry(seed) for seed in range(5)])
        lines = path.read_bytes().split(b"\n")
        lines[line + 1] = junk.replace(b"\n", b" ")
        path.write_bytes(b"\n".join(lines))
        with pytest.raises(InputError, match=rf"journal\.jsonl:{line + 2}: is damaged"), opened(path, HEADER):
            pass
        assert path.read_bytes() == b"\n".join(lines)


def test_a_later_line_of_the_same_run_counts(tmp_path: Path) -> None:
    lost = Entry("ab", 1, "lost", "its worker was killed", None, 0.1)
    path = journal_with(tmp_path, [lost, entry(1)])
    with opened(path, HEADER) as journal:
        assert journal.entries == {("ab", 1): entry(1)}


def test_a_line_is_whole_as_soon_as_it_is_written(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    with opened(path, HEADER) as journal:
        for seed in range(5):
            journal.append(entry(seed))
            assert path.read_bytes().endswith(b"\n")
            assert json.loads(path.read_bytes().splitlines()[-1])["run"]["seed"] == seed


def test_what_was_written_is_brought_to_the_disk_by_and_by(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    now, synced = [100.0], []
    monkeypatch.setattr("outrider.sweep.journal.time.monotonic", lambda: now[0])
    with opened(tmp_path / "journal.jsonl", HEADER) as journal:
        monkeypatch.setattr("outrider.sweep.journal.os.fsync", lambda _: synced.append(now[0]))
        journal.append(entry(1))
        journal.settle()
        assert synced == []
        now[0] = 100.6
        journal.append(entry(2))
        assert synced == []
        now[0] = 101.1
        journal.settle()
        journal.settle()
        assert synced == [101.1]
        journal.append(entry(3))
    assert synced == [101.1, 101.1]


# What is refused


def test_another_sweep_s_journal_is_refused(tmp_path: Path) -> None:
    path = journal_with(tmp_path, [entry(1)])
    before = path.read_bytes()
    other = HEADER._replace(name="loss", sweep="4567")
    with pytest.raises(InputError, match=r"is of another sweep \(swap\).*--out"), opened(path, other):
        pass
    assert path.read_bytes() == before


def test_other_versions_are_refused_and_named(tmp_path: Path) -> None:
    path = journal_with(tmp_path, [entry(1)])
    newer = HEADER._replace(versions={"outrider": "1", "numpy": "3", "numba": "1"})
    with (
        pytest.raises(InputError, match=r"numba None \(now 1\), numpy 2 \(now 3\)"),
        opened(path, newer),
    ):
        pass


def test_two_sweeps_at_once_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    with opened(path, HEADER) as journal:
        journal.append(entry(1))
        with pytest.raises(InputError, match="another sweep is running"), opened(path, HEADER):
            pass
        journal.append(entry(2))
    with opened(path, HEADER) as journal:
        assert len(journal.entries) == 2


def test_a_full_disk_is_said_and_what_it_tore_is_cut_away(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "journal.jsonl"
    write = os.write
    with opened(path, HEADER) as journal:
        journal.append(entry(1))
        monkeypatch.setattr("outrider.sweep.journal.os.write", lambda fd, data: write(fd, data[:10]))
        with pytest.raises(OutriderError, match="disk full"):
            journal.append(entry(2))
        monkeypatch.undo()
    with opened(path, HEADER) as journal:
        assert journal.entries == {("ab", 1): entry(1)}


def test_a_journal_that_cannot_be_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be opened"), opened(tmp_path / "no" / "journal", HEADER):
        pass
