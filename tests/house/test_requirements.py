"""pyproject.toml, uv.lock and requirements.txt say the same, so that uv and pip make the same environment."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
LOCK = tomllib.loads((ROOT / "uv.lock").read_text(encoding="utf-8"))
CLIENTS = sorted((ROOT / "tests" / "clients" / "requirements").glob("*.txt"))
EXTRAS, GROUPS = ("sitl", "export", "view", "cluster", "gym", "pandas"), ("dev",)


class Pin(NamedTuple):
    """One version of a package, and the hashes of the files that may be installed for it."""

    name: str
    version: str
    hashes: frozenset[str]


def locked() -> set[Pin]:
    """What the lock holds for the project with ``EXTRAS`` and ``GROUPS``, without the project itself."""
    versions: dict[str, list[dict[str, Any]]] = {}
    for package in LOCK["package"]:
        versions.setdefault(package["name"], []).append(package)
    (project,) = versions["outrider"]
    waiting = list(project["dependencies"])
    waiting += [edge for extra in EXTRAS for edge in project["optional-dependencies"][extra]]
    waiting += [edge for group in GROUPS for edge in project["dev-dependencies"][group]]
    pins: set[Pin] = set()
    while waiting:
        edge = waiting.pop()
        for package in versions[edge["name"]]:
            if edge.get("version", package["version"]) != package["version"]:
                continue
            files = [*package.get("wheels", ()), *([package["sdist"]] if "sdist" in package else ())]
            pin = Pin(package["name"], package["version"], frozenset(file["hash"] for file in files))
            if pin not in pins:
                pins.add(pin)
                waiting += package.get("dependencies", ())
            for extra in edge.get("extra", ()):
                waiting += package.get("optional-dependencies", {}).get(extra, ())
    return pins


def exported(file: Path = ROOT / "requirements.txt") -> set[Pin]:
    """What a file of requirements holds."""
    text = file.read_text(encoding="utf-8")
    pins = set()
    for block in re.split(r"\n(?=\S)", text.replace("\\\n", " ").strip()):
        requirement = Requirement(block.split("--hash", 1)[0])
        (specifier,) = requirement.specifier
        hashes = frozenset(re.findall(r"--hash=(\S+)", block))
        pins.add(Pin(canonicalize_name(requirement.name), specifier.version, hashes))
    return pins


def test_requirements_are_the_lock() -> None:
    ahead, behind = locked() - exported(), exported() - locked()
    assert not ahead, f"run `make requirements`: only in uv.lock {sorted((p.name, p.version) for p in ahead)}"
    assert not behind, f"run `make requirements`: only exported {sorted((p.name, p.version) for p in behind)}"


@pytest.mark.parametrize("file", [ROOT / "requirements.txt", *CLIENTS], ids=lambda file: file.stem)
def test_every_requirement_has_a_hash_and_no_host(file: Path) -> None:
    assert all(pin.hashes for pin in exported(file))
    assert "://" not in file.read_text(encoding="utf-8")


@pytest.mark.parametrize("file", CLIENTS, ids=lambda file: file.stem)
def test_clients_are_pinned_as_they_are_asked_for(file: Path) -> None:
    asked = [Requirement(line) for line in file.with_suffix(".in").read_text(encoding="utf-8").splitlines()]
    pins = exported(file)
    assert {canonicalize_name(requirement.name) for requirement in asked} == {pin.name for pin in pins}
    for requirement in asked:
        versions = [pin.version for pin in pins if pin.name == canonicalize_name(requirement.name)]
        assert all(requirement.specifier.contains(version) for version in versions), file


def test_the_lock_knows_what_the_project_asks_for() -> None:
    (project,) = (package for package in LOCK["package"] if package["name"] == "outrider")
    asked = [*PROJECT["project"]["dependencies"], *PROJECT["dependency-groups"]["dev"]]
    for needs in PROJECT["project"]["optional-dependencies"].values():
        asked += needs
    known = [*project["metadata"]["requires-dist"], *project["metadata"]["requires-dev"]["dev"]]
    assert {_asked(Requirement(text)) for text in asked} == {
        (canonicalize_name(edge["name"]), _bounds(edge.get("specifier", ""))) for edge in known
    }, "run `make requirements`"
    assert PROJECT["project"]["requires-python"] == LOCK["requires-python"]


def _asked(requirement: Requirement) -> tuple[str, frozenset[str]]:
    return canonicalize_name(requirement.name), _bounds(str(requirement.specifier))


def _bounds(specifier: str) -> frozenset[str]:
    return frozenset(part.strip() for part in specifier.split(",") if part.strip())
