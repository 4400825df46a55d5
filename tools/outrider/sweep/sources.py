"""Versions of the code that flies: a hash over the project's sources, and the versions of other packages.

The project's own version changes too seldom to identify the code.
"""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path

from outrider.errors import OutriderError
from outrider.resources import config_root

_PACKAGES = ("companion", "mavlink_bridge", "outrider", "sitl")
_LENGTH = 16
_OTHERS = ("outrider", "numpy", "numba", "piqp", "jsbsim", "pymavlink", "pymap3d")


def versions() -> dict[str, str]:
    """Return the versions of Python, machine, code and packages; besides the task, results depend on them."""
    found = {"python": platform.python_version(), "machine": platform.machine()}
    found["code"] = digest(sources())
    for package in _OTHERS:
        found[package] = version_of(package)
    return found


def differences(theirs: Mapping[str, str], ours: Mapping[str, str], word: str) -> list[str]:
    """Return the entries of two `versions` that differ, as ``numpy 2.3.0 (WORD 2.4.1)``."""
    return [
        f"{name} {theirs.get(name)} ({word} {ours.get(name)})"
        for name in sorted(theirs.keys() | ours.keys())
        if theirs.get(name) != ours.get(name)
    ]


def version_of(package: str) -> str:
    """Return the version of a package, or ``none`` if it is not installed."""
    try:
        return version(package)
    except PackageNotFoundError:
        return "none"


def sources() -> dict[str, Path]:
    """Return all files that a flight depends on and that are not in a cell of a sweep.

    They are the code of the project's packages and the recorded targets, by names that do not depend on their
    location.
    """
    found: dict[str, Path] = {}
    for package in _PACKAGES:
        spec = find_spec(package)
        if spec is None or not spec.submodule_search_locations:
            raise OutriderError(f"package {package} has no folder to read its sources from")
        folder = Path(spec.submodule_search_locations[0])
        found |= {f"{package}/{path.relative_to(folder).as_posix()}": path for path in folder.rglob("*.py")}
    logs = config_root() / "logs"
    return found | {f"logs/{path.name}": path for path in logs.iterdir() if path.is_file()}


def digest(files: Mapping[str, Path]) -> str:
    """Return a hash of the names and the contents of ``files``, independent of their order."""
    whole = hashlib.sha256()
    for name in sorted(files):
        whole.update(f"{name} {hashlib.sha256(files[name].read_bytes()).hexdigest()}\n".encode())
    return whole.hexdigest()[:_LENGTH]
