"""Which code flies: a hash over our own sources, as a version that seldom changes says nothing, and the
versions of what else results come from."""

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
_OTHERS = ("outrider", "numpy", "scipy", "numba", "piqp", "jsbsim", "filterpy", "pymavlink", "pymap3d")


def versions() -> dict[str, str]:
    """All that results depend on beside the task."""
    found = {"python": platform.python_version(), "machine": platform.machine()}
    found["code"] = digest(sources())
    for package in _OTHERS:
        found[package] = version_of(package)
    return found


def differences(theirs: Mapping[str, str], ours: Mapping[str, str], word: str) -> list[str]:
    """In which of `versions` two differ, as ``numpy 2.3.0 (WORD 2.4.1)``."""
    return [
        f"{name} {theirs.get(name)} ({word} {ours.get(name)})"
        for name in sorted(theirs.keys() | ours.keys())
        if theirs.get(name) != ours.get(name)
    ]


def version_of(package: str) -> str:
    """``none`` if it is not installed."""
    try:
        return version(package)
    except PackageNotFoundError:
        return "none"


def sources() -> dict[str, Path]:
    """All files that a flight depends on and no cell of a sweep holds: our packages' code, and the recorded
    targets; by a name that is the same wherever they lie."""
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
    """Another one if a name or a byte of ``files`` changes, whatever their order."""
    whole = hashlib.sha256()
    for name in sorted(files):
        whole.update(f"{name} {hashlib.sha256(files[name].read_bytes()).hexdigest()}\n".encode())
    return whole.hexdigest()[:_LENGTH]
