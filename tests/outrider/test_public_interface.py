"""Public names are importable and described; importing the package loads nothing heavy."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from importlib.resources import files
from inspect import getdoc
from pathlib import Path

import pytest

import companion
import mavlink_bridge
import outrider
import sitl

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("name", outrider.__all__)
def test_each_public_name_is_there_and_described(name: str) -> None:
    value = getattr(outrider, name)
    assert isinstance(value, str) or getdoc(value)


def test_the_list_of_names_is_complete() -> None:
    assert list(outrider.__all__) == sorted(outrider.__all__, key=str)
    assert set(outrider._PLACES) == set(outrider.__all__) - {"__version__", "sim"}
    assert sorted(dir(outrider)) == sorted(outrider.__all__)
    with pytest.raises(AttributeError, match="nothing"):
        _ = outrider.nothing


def test_the_version_is_that_of_the_project() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert outrider.__version__ == project["version"]


def test_types_are_shipped() -> None:
    for package in (outrider, companion, sitl, mavlink_bridge):
        assert files(package).joinpath("py.typed").is_file()


@pytest.mark.slow
def test_planner_physics_and_flights_need_nothing_that_only_posix_has() -> None:
    """As on Windows: no fcntl, no fork. docs/platforms.md says so."""
    code = """
import os, sys
for name in ("fcntl", "pwd", "grp", "termios", "resource", "tty", "pty"):
    sys.modules[name] = None
del os.fork
import outrider
import outrider.__main__
assert outrider.Planner().step(0.0, (0, 0, 5), (0, 0, 0), goal=(3, 0, 5)).plan
outrider.sim.Batch().step([[0, 0, 6]])
short = {"airborne": True, "cap_s": 0.2, "companion": {"rates": {"replan_us": 100_000}}}
outrider.fly("antipodal-8", vehicles=2, **short).to_html()
"""
    subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)


def test_an_import_loads_nothing_heavy() -> None:
    """The command line imports the package too: it must not get slower."""
    heavy = "('numpy', 'numba', 'pydantic', 'typer')"
    code = f"import sys, outrider; print([name for name in {heavy} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
