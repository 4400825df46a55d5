"""Every example runs as it is, in a process of its own, and prints what it promises."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.clients.client_rig import python
from tests.clients.sitl_process import _free_ports

pytestmark = pytest.mark.slow

FOLDER = Path(__file__).parents[2] / "examples"
SAID = {
    "planner.py": r"swapped after \d\.\d s, never nearer than [1-9]\.\d+ m",
    "certified.py": r"swapped after \d+\.\d s .*, never nearer than [1-9]\.\d+ m",
    "own_surface.py": r"\[ 4\. .*\n.*\[ 4\. .*\n.*\[-4\. ",
    "own_method.py": r"without the method: 0\.\d+ m to the left\nwith it: +[1-9]\.\d+ m",
    "batch.py": r"million vehicle-steps a second of CPU time\nmedian distance from the circle: \d cm",
    "learning.py": r"mean reward of a step: -0\.0\d+; episodes that ended early: 0",
    "flight.py": r"converged after \d+\.\d+ s\n(.*\n)*report: \d+ KiB",
}
BY_MAVSDK = {
    "sitl_mavsdk.py": (r"after two seconds: \d\.\d m north(.*\n)+landed", "px4"),
    "beside_mavsdk.py": (r"15 m further north\nthe companion of vehicle 1: .*escort", "ardupilot"),
}


def test_the_page_names_every_example() -> None:
    there = {path.name for path in FOLDER.iterdir() if path.suffix in (".py", ".ipynb")}
    assert there == {*SAID, *BY_MAVSDK, "flight.ipynb"}
    assert there == set(re.findall(r"^\| \[([\w.]+)\]", (FOLDER / "README.md").read_text(), re.MULTILINE))


@pytest.mark.parametrize("name", SAID)
def test_an_example_runs(name: str, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-W", "error", FOLDER / name],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert re.search(SAID[name], done.stdout), done.stdout
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", BY_MAVSDK)
def test_an_example_with_mavsdk_runs(name: str, tmp_path: Path) -> None:
    said, flavour = BY_MAVSDK[name]
    port, _ = _free_ports(flavour, 60)
    kept = {key: value for key, value in os.environ.items() if not key.startswith(("PYTHON", "VIRTUAL"))}
    kept["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{kept['PATH']}"
    done = subprocess.run(
        [python("mavsdk3"), FOLDER / name, str(port)],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env=kept,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert re.search(said, done.stdout), done.stdout


def test_the_notebook_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its cells run in order; the last value of each is what a notebook would show."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    cells = json.loads((FOLDER / "flight.ipynb").read_text(encoding="utf-8"))["cells"]
    source = "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")
    assert not any(cell.get("outputs") for cell in cells)
    shown: dict[str, object] = {}
    exec(compile(source, "flight.ipynb", "exec"), shown)
    assert "<iframe" in shown["flight"]._repr_html_()  # type: ignore[attr-defined]
