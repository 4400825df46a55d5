"""Which code flies: a hash over our own sources, as a version that seldom changes says nothing."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path

from outrider.errors import OutriderError
from outrider.resources import config_root

_PACKAGES = ("companion", "mavlink_bridge", "outrider", "sitl")
_LENGTH = 16


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
