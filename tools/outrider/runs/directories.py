"""Output directories of runs: they are new, so that nothing is overwritten."""

from __future__ import annotations

from pathlib import Path

from outrider.errors import InputError


def new_directory(out: Path | None, stem: str) -> Path:
    """Return a new, empty directory: ``out``, or the first free ``runs/STEM[-k]``.

    Raises InputError if ``out`` exists and is not an empty directory, or if it cannot be made.
    """
    if out is not None:
        if out.exists() and (not out.is_dir() or any(out.iterdir())):
            raise InputError(f"--out {out}: exists and is not an empty directory")
        return _made(out)
    runs = _made(Path("runs"))
    number = 1
    while not _is_new(path := runs / (stem if number == 1 else f"{stem}-{number}")):
        number += 1
    return path


def _is_new(path: Path) -> bool:
    """Make ``path`` and return True, or False if it exists: two runs that start at once never share one."""
    try:
        path.mkdir()
    except FileExistsError:
        return False
    except OSError as error:
        raise InputError(f"{path}: cannot be made: {error.strerror}") from None
    return True


def _made(path: Path) -> Path:
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{path}: cannot be made: {error.strerror}") from None
    return path
