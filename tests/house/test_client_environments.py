"""The environments of the clients, on a machine on which one of them is not to be had."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

TOOLS = Path(__file__).parents[2] / "tools"
NOWHERE = "outrider-has-no-such-client==1.0 --hash=sha256:" + 64 * "0" + "\n"

pytestmark = pytest.mark.slow


def run(path: Path, **more: str) -> subprocess.CompletedProcess[str]:
    """The script in a folder of its own, with a client that has no wheel and one that needs none; offline."""
    (path / "tools").mkdir()
    for name in ("bootstrap.py", "client_environments.py"):
        shutil.copy(TOOLS / name, path / "tools")
    requirements = path / "tests" / "clients" / "requirements"
    requirements.mkdir(parents=True)
    (requirements / "absent.txt").write_text(NOWHERE)
    (requirements / "empty.txt").write_text("")
    (path / ".venv").mkdir()
    kept = {key: value for key, value in os.environ.items() if key != "CI"}
    return subprocess.run(
        [sys.executable, path / "tools" / "client_environments.py"],
        env={**kept, "PATH": str(path), "PIP_NO_INDEX": "1", "PIP_FIND_LINKS": "", **more},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
    )


def test_who_has_no_wheel_here_is_named_and_left_out(tmp_path: Path) -> None:
    done = run(tmp_path)
    assert done.returncode == 0
    assert "client absent: pip failed" in done.stderr
    assert "tests with absent are skipped" in done.stdout
    clients = tmp_path / ".venv" / "clients"
    assert (clients / "empty" / ".made").exists()
    assert not (clients / "absent" / "bin" / "python").exists()
    assert not (clients / ".made").exists()


def test_in_ci_that_is_an_error(tmp_path: Path) -> None:
    done = run(tmp_path, CI="1")
    assert done.returncode == 1
    assert "client absent: pip failed" in done.stderr
