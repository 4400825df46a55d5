"""What programs and commands say when a start compiles: once for each package, before it happens."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.companion.values.test_compiled import READ_ONLY

KERNELS = """
import sys
from companion.values.compiled import FLOAT, kernel


@kernel(FLOAT, FLOAT)
def twice(x):
    return 2.0 * x


sys.stderr.write("twice\\n")


@kernel(FLOAT, FLOAT)
def thrice(x):
    return 3.0 * x


sys.stderr.write("thrice\\n")
"""
LOAD = """
import companion, sitl
companion.__path__.append("companion_too")
sitl.__path__.append("sitl_too")
import companion.new_kernels, sitl.new_kernels
"""
PROGRAM = "from outrider.terminal.compilation import log_if_compiling\nlog_if_compiling()\n"
COMMAND = "from outrider.terminal.compilation import say_if_compiling\nsay_if_compiling()\n"
PLANNER = "compiling the planner: 40 s on a PC, longer on a small computer; "
PHYSICS = "compiling the physics of this type of vehicle: 10 to 30 s on a PC; "


def said(folder: Path, before: str, code: str = LOAD) -> list[str]:
    """Return the lines on standard error of a program in ``folder`` that runs ``before`` and ``code``.

    In ``folder`` both packages have another module with two kernels.
    """
    for part in ("companion_too", "sitl_too"):
        module = folder / part / "new_kernels.py"
        if not module.exists():
            module.parent.mkdir()
            module.write_text(KERNELS)
    command = [sys.executable, "-c", f"{before}\n{code}"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
    assert done.stdout == ""
    return done.stderr.splitlines()


def test_a_program_is_told_once_for_each_package_and_never_again(tmp_path: Path) -> None:
    later = "later starts load the result"
    first = [PLANNER + later, "twice", "thrice", PHYSICS + later, "twice", "thrice"]
    assert said(tmp_path, PROGRAM) == first
    assert said(tmp_path, PROGRAM) == ["twice", "thrice", "twice", "thrice"]


def test_logging_can_turn_it_off(tmp_path: Path) -> None:
    off = "import logging\nlogging.getLogger('outrider').setLevel(logging.ERROR)\n"
    assert said(tmp_path, off + PROGRAM) == ["twice", "thrice", "twice", "thrice"]


def test_a_command_says_it_in_place_of_the_log(tmp_path: Path) -> None:
    lines = said(tmp_path, READ_ONLY + COMMAND + PROGRAM)
    assert [line for line in lines if "compiling" in line] == [
        f"outrider: {text}no directory can be written, so every start compiles: "
        "set NUMBA_CACHE_DIR to one that can"
        for text in (PLANNER, PHYSICS)
    ]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("first", "text"),
    [
        ("from outrider import Planner; Planner()", PLANNER),
        ("from outrider.sim import Batch; b = Batch('firefly', 1); b.step(b.positions, 1)", PHYSICS),
    ],
)
def test_the_public_names_say_that_they_compile(
    first: str, text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(os.environ, "NUMBA_CACHE_DIR", str(tmp_path / "store"))
    (line,) = said(tmp_path, "", first)
    assert line.startswith(text)
    assert said(tmp_path, "", first) == []
