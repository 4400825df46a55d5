"""One reader of array files: what is damaged is an error that names the file, whichever command reads it."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from outrider.errors import InputError
from outrider.report import arrays as report
from outrider.runs import array_file
from outrider.runs.array_file import read_arrays
from outrider.runs.arrays import read_plans
from outrider.runs.steps_file import read_steps

SHAPES = {"system": ("n",), "time_s": ("n",), "plan_ms": ("n",)}
READERS: dict[str, Callable[[Path], object]] = {
    "report": report.plan_times,
    "export": lambda path: read_plans(path, "plan_ms", None, 0),
    "replay": read_steps,
}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A file that all readers can read."""
    path = tmp_path / "arrays.npz"
    whole = np.arange(5)
    np.savez_compressed(
        path, system=whole, time_s=0.1 * whole, plan_ms=0.2 * whole, first=whole[:1], gaps=whole
    )
    return path


def encrypt(path: Path) -> None:
    """Mark all entries as encrypted."""
    data = bytearray(path.read_bytes())
    for mark, flags in ((b"PK\3\4", 6), (b"PK\1\2", 8)):
        place = data.find(mark)
        while place >= 0:
            data[place + flags] |= 1
            place = data.find(mark, place + 1)
    path.write_bytes(data)


@pytest.mark.parametrize("reader", READERS)
def test_all_read_what_is_sound(reader: str, path: Path) -> None:
    assert READERS[reader](path) is not None


@pytest.mark.parametrize("reader", READERS)
def test_an_encrypted_file_is_refused(reader: str, path: Path) -> None:
    encrypt(path)
    with pytest.raises(InputError, match=r"arrays\.npz: cannot be read: .*encrypted"):
        READERS[reader](path)


@pytest.mark.parametrize("reader", READERS)
def test_a_file_that_unpacks_to_too_much_is_refused(
    reader: str, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with zipfile.ZipFile(path) as archive:
        size = sum(entry.file_size for entry in archive.infolist())
    monkeypatch.setattr(array_file, "MOST_BYTES", size - 1)
    with pytest.raises(InputError, match=rf"arrays\.npz: unpacks to {size} bytes"):
        READERS[reader](path)


@given(data=st.binary(max_size=400))
def test_what_is_no_file_of_arrays_is_refused(data: bytes, tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.getbasetemp() / "nonsense.npz"
    path.write_bytes(data)
    with pytest.raises(InputError):
        read_arrays(path, SHAPES)
