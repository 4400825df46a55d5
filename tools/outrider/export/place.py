"""Where an export goes: beside what it is made from or where the user says, whole or not at all."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import mkdtemp
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
        raise InputError(f"{out}: exists, and nothing is overwritten; allowed: --out with {allowed}")
    return out


def _default(source: Path, form: str) -> Path:
    if source.is_dir():
        return source / (f"{_STEM}.{form}" if form == FILE else form)
    stem = source.name.removesuffix(".gz").removesuffix(".tlog") or source.name
    return source.with_name(f"{stem}.{form}" if form == FILE else f"{stem}-{form}")


@contextmanager
def fresh(path: Path, form: str) -> Iterator[Path]:
    """Where to write: in a folder of its own beside ``path``, to which the result moves when all is done; the
    folder vanishes in any case.

    Raises InputError if that cannot be made.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        folder = Path(mkdtemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent))
    except OSError as error:
        raise InputError(f"{path.parent}: nothing can be made in it: {error.strerror}") from None
    try:
        part = folder / path.name
        if form in FOLDER:
            part.mkdir()
        yield part
        if path.is_dir():
            path.rmdir()
        part.rename(path)
    finally:
        shutil.rmtree(folder)
