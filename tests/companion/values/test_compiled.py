"""Stored kernels: a start loads them, and works where they are damaged or cannot be stored."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

MODULE = """
from companion.values.compiled import FLOAT, kernel


@kernel(FLOAT, FLOAT)
def twice(x):
    return 2.0 * x


print("twice", twice(4.0), "loaded" if twice.stats.cache_hits else "compiled")
"""
WITH_PARTS = """
from companion.values.compiled import FLOAT, kernel
from doubled import doubled


@kernel(FLOAT, FLOAT)
def twice(x):
    return doubled(x)


print("twice", twice(4.0), "loaded" if twice.stats.cache_hits else "compiled")
"""
DOUBLED = """
from companion.values.compiled import part
from factor import times


@part
def doubled(x):
    return times(x)
"""
FACTOR = """
from companion.values.compiled import part
from number import NUMBER


@part
def times(x):
    return NUMBER * x
"""
CALLING = (
    MODULE
    + """

@kernel(FLOAT, FLOAT)
def four_times(x):
    return twice(twice(x))
"""
)
READ_ONLY = """
import tempfile


def refused(**_):
    raise OSError(30, "Read-only file system")


tempfile.TemporaryFile = refused
"""
FULL = """
from numba.core.caching import IndexDataCacheFile


def refused(*_):
    raise OSError(28, "No space left on device")


IndexDataCacheFile._open_for_write = refused
"""


def start(folder: Path, before: str = "", module: str = MODULE) -> list[str]:
    """Run the ``module`` in ``folder`` as a process, after the code ``before``; return its lines."""
    (folder / "kernels.py").write_text(module)
    command = [sys.executable, "-c", f"{before}\nimport kernels"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
    return done.stdout.splitlines()


def test_the_second_start_loads(tmp_path: Path) -> None:
    assert start(tmp_path) == ["twice 8.0 compiled"]
    assert start(tmp_path) == ["twice 8.0 loaded"]


@pytest.mark.parametrize(
    ("file", "old", "new"), [("factor", "NUMBER * x", "NUMBER * x + 4.0"), ("number", "2.0", "3.0")]
)
def test_a_part_of_a_part_or_a_constant_that_changes_in_another_file_is_compiled_again(
    file: str, old: str, new: str, tmp_path: Path
) -> None:
    for name, text in (("doubled", DOUBLED), ("factor", FACTOR), ("number", "NUMBER = 2.0")):
        (tmp_path / f"{name}.py").write_text(text)
    assert start(tmp_path, module=WITH_PARTS) == ["twice 8.0 compiled"]
    assert start(tmp_path, module=WITH_PARTS) == ["twice 8.0 loaded"]
    changed = tmp_path / f"{file}.py"
    changed.write_text(changed.read_text().replace(old, new))
    assert start(tmp_path, module=WITH_PARTS) == ["twice 12.0 compiled"]
    assert start(tmp_path, module=WITH_PARTS) == ["twice 12.0 loaded"]


def test_a_kernel_that_calls_another_one_is_refused(tmp_path: Path) -> None:
    with pytest.raises(subprocess.CalledProcessError) as refused:
        start(tmp_path, module=CALLING)
    assert "TypeError: four_times calls twice, which is a kernel and no part" in refused.value.stderr


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
@pytest.mark.parametrize("share", [0.0, 0.5])
def test_a_damaged_store_is_replaced(suffix: str, share: float, tmp_path: Path) -> None:
    start(tmp_path)
    (stored,) = tmp_path.rglob(f"*.{suffix}")
    whole = stored.read_bytes()
    stored.write_bytes(whole[: int(share * len(whole))])
    assert start(tmp_path)[-1] == "twice 8.0 compiled"
    assert start(tmp_path) == ["twice 8.0 loaded"]


def test_a_read_only_system_compiles_at_each_start(tmp_path: Path) -> None:
    for _ in range(2):
        assert start(tmp_path, READ_ONLY) == ["twice 8.0 compiled"]


def test_a_full_disk_stores_nothing(tmp_path: Path) -> None:
    assert start(tmp_path, FULL)[-1] == "twice 8.0 compiled"
    assert not list(tmp_path.rglob("*.nbc"))
