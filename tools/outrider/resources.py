"""Location of the shipped configuration, in a checkout and in an installed wheel."""

from __future__ import annotations

from difflib import get_close_matches
from pathlib import Path

from outrider.errors import InputError


def config_root() -> Path:
    """Return the folder with ``vehicles``, ``scenarios``, ``companions`` and ``logs``."""
    here = Path(__file__).resolve().parent
    installed = here / "config"
    return installed if installed.is_dir() else here.parents[1] / "config"


def find(kind: str, name: str) -> Path:
    """Return the file for ``name``: a path, or the name of a shipped file of ``kind``.

    ``kind`` is a folder of the configuration. Raises InputError for a path (a name with a folder or the
    suffix of a YAML file) without a file, and, with the available names and the nearest one, for any other
    name.
    """
    folder = config_root() / kind
    shipped = {path.stem: path for path in sorted(folder.glob("*.yaml"))}
    if name in shipped:
        return shipped[name]
    path = Path(name)
    if path.suffix in (".yaml", ".yml") or path.parent != Path():
        if path.is_file():
            return path
        raise InputError(f"{name}: there is no such file")
    near = get_close_matches(name, shipped, n=1)
    hint = f"; did you mean {near[0]!r}?" if near else ""
    raise InputError(
        f"{name}: neither a file nor a shipped name; {kind} are {', '.join(shipped) or 'none'}{hint}"
    )
