"""Destination of an export: in or beside the source, or at ``--out``; written completely or not at all."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import mkdtemp
from typing import Final

from outrider.errors import InputError
from outrider.export.foxglove_layout import layout_path

FILE, FOLDER = "mcap", ("csv", "parquet", "ulog")
FORMATS: Final = (FILE, *FOLDER)
_STEM: Final = "flight"


def destination(source: Path, form: str, out: Path | None) -> Path:
    """Return the path to write to: ``out``, or the default if it is None.

    The default is ``flight.mcap`` or a folder ``csv``, ``parquet`` or ``ulog`` in a run directory, and
    ``NAME.mcap`` or ``NAME-csv``, … beside a log. Raises InputError if the path exists, unless it is an empty
    directory and the format needs one.
    """
    if out is None:
        out = _default(source, form)
    if out.exists() and not (form in FOLDER and out.is_dir() and not any(out.iterdir())):
        allowed = "a new or empty directory" if form in FOLDER else "a new file"
        raise InputError(f"{out}: exists, and nothing is overwritten; allowed: --out with {allowed}")
    if form == FILE and layout_path(out).exists():
        raise InputError(
            f"{layout_path(out)}: exists, and nothing is overwritten; allowed: --out with a new file"
        )
    return out


def _default(source: Path, form: str) -> Path:
    if source.is_dir():
        return source / (f"{_STEM}.{form}" if form == FILE else form)
    stem = source.name.removesuffix(".gz").removesuffix(".tlog") or source.name
    return source.with_name(f"{stem}.{form}" if form == FILE else f"{stem}-{form}")


@contextmanager
def fresh(path: Path, form: str) -> Iterator[Path]:
    """Provide a temporary path to write to, and move the result to ``path`` if no error occurs.

    A file that was written beside the temporary path moves with it.

    The temporary folder is beside ``path`` and is deleted in any case. Raises InputError if it cannot be
    created.
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
        for beside in folder.iterdir():
            beside.rename(path.with_name(beside.name))
    finally:
        shutil.rmtree(folder)
