"""The wheel, built and installed as a user has it: in an environment and a folder of its own, from which no
checkout is seen, with only those packages that it says it needs."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import zipfile
from collections.abc import Iterable
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]
OUR_OWN = {"companion", "sitl", "mavlink_bridge", "outrider"}
CONFIG = ("scenarios", "vehicles", "sweeps", "scenes", "logs", "schemas")
EXTRA = {"jsbsim", "viser", "mcap", "pyarrow"}
"""What no core install has."""
SITL = {"jsbsim"}
ADVICE = "pip install '.[sitl]'"

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built by the backend that pyproject.toml names, without the network."""
    folder = tmp_path_factory.mktemp("dist")
    run([sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", str(folder)], ROOT)
    (found,) = folder.glob("*.whl")
    return found


class Installed:
    """A virtual environment with the wheel, and links to the packages of this one that it may see."""

    def __init__(self, wheel: Path, folder: Path, extras: Iterable[str]) -> None:
        self.folder = folder / "elsewhere"
        self.folder.mkdir()
        environment = folder / "venv"
        run([sys.executable, "-m", "venv", "--without-pip", str(environment)], folder)
        self._bin = environment / "bin"
        install(self._bin / "python", wheel)
        shown = folder / "packages"
        shown.mkdir()
        self.packages = needed(wheel, extras)
        for name in self.packages:
            link(name, shown)
        (site,) = environment.glob("lib/python*/site-packages")
        (site / "packages.pth").write_text(f"{shown}\n")

    def python(self, program: str) -> subprocess.CompletedProcess[str]:
        """Run ``program``."""
        return self._run(str(self._bin / "python"), "-c", program)

    def outrider(self, *words: str) -> subprocess.CompletedProcess[str]:
        """Run the command, from the folder elsewhere."""
        return self._run(str(self._bin / "outrider"), *words)

    def _run(self, *command: str) -> subprocess.CompletedProcess[str]:
        kept = {key: value for key, value in os.environ.items() if not key.startswith(("PYTHON", "VIRTUAL"))}
        return subprocess.run(
            command,
            cwd=self.folder,
            env=kept,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            check=False,
        )


@pytest.fixture(scope="module")
def core(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Installed:
    """``pip install outrider``."""
    return Installed(wheel, tmp_path_factory.mktemp("core"), ())


@pytest.fixture(scope="module")
def full(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Installed:
    """``pip install '.[sitl]'``."""
    return Installed(wheel, tmp_path_factory.mktemp("full"), ("sitl",))


def run(command: list[str], cwd: Path) -> None:
    done = subprocess.run(
        command, cwd=cwd, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def install(python: Path, wheel: Path) -> None:
    """By pip or uv, of which one made this environment: an installer that is not ours reads the wheel."""
    options = ["--no-deps", "--no-index", str(wheel)]
    ways = [
        [*pip, "--python", str(python), "install", "--disable-pip-version-check", *options]
        for pip in ([sys.executable, "-m", "pip"], ["python3", "-m", "pip"], ["pip3"], ["pip"])
    ]
    ways.append(["uv", "pip", "install", "--python", str(python), *options])
    said = []
    for way in ways:
        try:
            done = subprocess.run(
                way, cwd=python.parent, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False
            )
        except OSError as error:
            said.append(str(error))
            continue
        if done.returncode == 0:
            return
        said.append(done.stderr)
    pytest.fail("no pip and no uv could install the wheel:\n" + "\n".join(said))


def needed(wheel: Path, extras: Iterable[str]) -> set[str]:
    """Every package that the wheel says it needs with ``extras``, and that those need."""
    with zipfile.ZipFile(wheel) as archive:
        (name,) = (one for one in archive.namelist() if one.endswith(".dist-info/METADATA"))
        metadata = archive.read(name).decode()
    waiting = [
        (requirement, tuple(extras))
        for requirement in re.findall(r"^Requires-Dist: (.*)$", metadata, re.MULTILINE)
    ]
    found: set[str] = set()
    done = set()
    while waiting:
        text, asked = waiting.pop()
        requirement = Requirement(text)
        marker = requirement.marker
        if marker is not None and not any(marker.evaluate({"extra": extra}) for extra in (*asked, "")):
            continue
        name, wanted = canonicalize_name(requirement.name), tuple(sorted(requirement.extras))
        if (name, wanted) in done:
            continue
        done.add((name, wanted))
        found.add(name)
        waiting += [(line, wanted) for line in distribution(name).requires or ()]
    return found


def link(name: str, folder: Path) -> None:
    """Make a package of this environment visible in ``folder``."""
    package = distribution(name)
    for top in {file.parts[0] for file in package.files or ()}:
        there = Path(str(package.locate_file(top)))
        here = folder / top
        if top not in ("..", "__pycache__") and there.exists() and not here.exists():
            here.symlink_to(there)


def test_the_wheel_holds_the_house_and_nothing_else(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
    assert {name.partition("/")[0] for name in names if ".dist-info/" not in name} == OUR_OWN
    assert any(name.endswith(".dist-info/licenses/LICENSE") for name in names)
    for kind in CONFIG:
        inside = f"outrider/config/{kind}/"
        files = [path for path in (ROOT / "config" / kind).rglob("*") if path.is_file()]
        assert {name for name in names if name.startswith(inside)} == {
            f"{inside}{path.name}" for path in files
        }
        assert files
    for package in OUR_OWN:
        folder = ROOT / ("tools" if package == "outrider" else "") / package
        modules = {f"{package}/{path.relative_to(folder)}" for path in folder.rglob("*.py")}
        assert {name for name in names if name.startswith(f"{package}/") and name.endswith(".py")} == modules
    page = ROOT / "tools" / "outrider" / "report" / "static"
    assert {f"outrider/report/static/{path.name}" for path in page.iterdir()} <= set(names)
    assert not any("__pycache__" in name or name.startswith("tests") for name in names)


def test_a_core_install_has_no_package_of_an_extra(core: Installed) -> None:
    assert not core.packages & EXTRA
    found = core.python(f"from importlib.util import find_spec; print([n for n in {EXTRA} if find_spec(n)])")
    assert found.stdout == "[]\n"


@pytest.mark.parametrize(
    "module",
    [
        "companion.node",
        "mavlink_bridge.loops.realtime",
        "mavlink_bridge.links.opening",
        "mavlink_bridge.tlog.log",
        "outrider.report.command",
        "outrider.resources",
        "outrider.yaml_files.yaml_file",
        "outrider.scenarios.scenario",
        "outrider.sweep.grid",
        "outrider.export.ulog_export",
        "sitl.environment.weather",
    ],
)
def test_what_flies_on_a_vehicle_needs_the_core_alone(core: Installed, module: str) -> None:
    done = core.python(f"import sys, {module}; print(sorted({EXTRA} & {{*sys.modules}}), {module}.__file__)")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("[] ")
    assert str(ROOT) not in done.stdout


def test_a_core_install_plans_and_speaks(core: Installed) -> None:
    """A companion is made with the shipped scenario's settings, connects, and answers its first heartbeat."""
    done = core.python(
        "from companion.node import Companion\n"
        "from mavlink_bridge.wire.codec import Codec\n"
        "from mavlink_bridge.frames import FleetFrame\n"
        "from mavlink_bridge.messages import Heartbeat, Source\n"
        "from mavlink_bridge.node import Datagram\n"
        "from outrider.resources import find\n"
        "from outrider.scenarios.scenario import Scenario\n"
        "from outrider.yaml_files.yaml_file import load\n"
        "config = load(find('scenarios', 'escort'), Scenario).companion\n"
        "node = Companion(config, 11, 1, FleetFrame(47.0, 8.0, 400.0), lambda: 0)\n"
        "beat = Codec().encode(Heartbeat(Source(11, 1), 2, 3, 1, 0, 4))\n"
        "sent = [d for k in range(100) for d in node.step(k * 10_000, [Datagram('autopilot', beat)])]\n"
        "print(sorted({d.link for d in sent}))\n"
    )
    assert done.stdout == "['autopilot', 'swarm']\n", done.stderr


def test_help_needs_the_core_alone(core: Installed) -> None:
    done = core.outrider("--help")
    assert done.returncode == 0, done.stderr
    assert "swarm" in done.stdout


def test_what_needs_the_sitl_says_how_to_get_it(core: Installed) -> None:
    done = core.outrider("swarm", "antipodal-8", "--physics", "jsbsim")
    assert done.returncode == 3
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    assert ADVICE in done.stderr
    assert not list(core.folder.iterdir())


def test_exports_need_the_core_alone_or_say_how_to_get_more(core: Installed) -> None:
    log = str(ROOT / "config" / "logs" / "escort-target.tlog")
    for form in ("mcap", "csv", "parquet"):
        done = core.outrider("export", log, "--format", form, "--out", "out")
        assert (done.returncode, done.stdout, done.stderr.count("\n")) == (3, "", 1)
        assert "pip install '.[export]'" in done.stderr
    done = core.outrider("export", log, "--format", "ulog", "--out", "out")
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert "no vehicle speaks in it" in done.stderr
    assert not list(core.folder.iterdir())


def test_a_full_install_flies_from_anywhere(full: Installed) -> None:
    assert full.packages | ({"jsbsim"} if not_here("jsbsim") else set()) >= SITL
    words = ("swarm", "antipodal-8", "--vehicles", "2", "--replan-hz", "20", "--out", "flight")
    done = full.outrider(*words)
    assert done.returncode == 0, done.stderr
    left = {path.name for path in (full.folder / "flight").iterdir()}
    assert left >= {"vehicle-11.tlog", "vehicle-12.tlog", "summary.json", "configuration.yaml"}


def test_a_full_install_sweeps_by_a_shipped_name(full: Installed) -> None:
    done = full.outrider("sweep", "smoke", "--runs", "1", "--jobs", "1", "--out", "sweep", "--json")
    assert done.returncode in (0, 1), done.stderr
    assert (full.folder / "sweep" / "summary.json").exists()


def not_here(name: str) -> bool:
    """Whether this environment lacks a package, as it may on a machine without a wheel of it."""
    try:
        distribution(name)
    except PackageNotFoundError:
        return True
    return False
