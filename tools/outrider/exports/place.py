"""Where an export goes: beside what it is made from or where the user says, whole or not at all."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from outrider.errors import InputError

FILE, FOLDER = "mcap", ("csv", "parquet", "ulog")
FORMATS: Final = (FILE, *FOLDER)
_STEM: Final = "flight"


def destination(source: Path, form: str, out: Path | None) -> Path:
    """``out``, or by default ``flight.mcap`` or a folder ``csv``, ``parquet``, ``ulog`` in a run directory,
    and ``NAME.mcap`` or ``NAME-csv``, … beside a log. Raises InputError if there is something already."""
    if out is None:
        out = _default(source, form)
    if out.exists() and not (form in FOLDER and out.is_dir() and not any(out.iterdir())):
        allowed = "a new or empty directory" if form in FOLDER else "a new file"
        raise InputError(f"--out {out}: exists, and nothing is overwritten; allowed: {allowed}")
    return out


def _default(source: Path, form: str) -> Path:
    if source.is_dir():
        return source / (f"{_STEM}.{form}" if form == FILE else form)
    stem = source.name.removesuffix(".gz").removesuffix(".tlog") or source.name
    return source.with_name(f"{stem}.{form}" if form == FILE else f"{stem}-{form}")


@contextmanager
def fresh(path: Path, form: str) -> Iterator[Path]:
    """Where to write: under another name, which becomes ``path`` when all is done, and vanishes when it is
    not.

    Raises InputError if that cannot be made.
    """
    part = path.with_name(f"{path.name}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        _remove(part)
        if form in FOLDER:
            part.mkdir()
        else:
            part.touch()
    except OSError as error:
        raise InputError(f"{part}: cannot be made: {error.strerror}") from None
    try:
        yield part
        if path.is_dir():
            path.rmdir()
        part.rename(path)
    finally:
        _remove(part)


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)
