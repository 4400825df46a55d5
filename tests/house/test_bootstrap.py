"""The set-up script on machines that lack what it needs: one clear line, never a traceback."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
SCRIPT = ROOT / "tools" / "bootstrap.py"


def run(before: str, path: Path) -> subprocess.CompletedProcess[str]:
    """The script, copied to a folder of its own, after a statement that makes this Python look poorer."""
    copy = path / "tools" / "bootstrap.py"
    copy.parent.mkdir()
    copy.write_bytes(SCRIPT.read_bytes())
    (path / "requirements.txt").write_text("")
    program = f"import runpy, sys; {before}; runpy.run_path({str(copy)!r}, run_name='__main__')"
    return subprocess.run(
        [sys.executable, "-c", program],
        env=dict(os.environ, PATH=str(path)),
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
    )


def test_an_old_python_can_read_it() -> None:
    ast.parse(SCRIPT.read_text(encoding="utf-8"), feature_version=(3, 6))


def test_an_old_python_is_told_so(tmp_path: Path) -> None:
    done = run("sys.version_info = (3, 9, 2)", tmp_path)
    assert done.returncode == 1
    assert done.stderr.startswith("outrider: Python 3.11 or newer is needed, python3 is 3.9 here")
    assert done.stderr.count("\n") == 1


def test_a_machine_without_any_pip_is_told_what_to_install(tmp_path: Path) -> None:
    done = run("sys.executable = '/nonexistent/python3'", tmp_path)
    assert done.returncode == 1
    assert "apt install python3-venv" in done.stderr
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / ".venv").exists()
