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


def test_an_import_loads_nothing_heavy() -> None:
    """The command line imports the package too: it must not get slower."""
    heavy = "('numpy', 'numba', 'pydantic', 'typer')"
    code = f"import sys, outrider; print([name for name in {heavy} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
