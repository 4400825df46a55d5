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


@part
def times(x):
    return 2.0 * x
"""
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


def test_a_part_of_a_part_that_changes_in_another_file_is_compiled_again(tmp_path: Path) -> None:
    (tmp_path / "doubled.py").write_text(DOUBLED)
    (tmp_path / "factor.py").write_text(FACTOR)
    assert start(tmp_path, module=WITH_PARTS) == ["twice 8.0 compiled"]
    assert start(tmp_path, module=WITH_PARTS) == ["twice 8.0 loaded"]
    (tmp_path / "factor.py").write_text(FACTOR.replace("2.0", "3.00"))
    assert start(tmp_path, module=WITH_PARTS) == ["twice 12.0 compiled"]
    assert start(tmp_path, module=WITH_PARTS) == ["twice 12.0 loaded"]


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
