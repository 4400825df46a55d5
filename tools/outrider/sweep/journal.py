"""Journal of a sweep: a header, then a JSON line each time that a run ends or is lost; lines never change.

A line counts when its newline is written; an incomplete line after the last newline is removed on resume.
Each line is one write on a file opened to append. Lines are synced to the disk when `SYNC_S` have passed
since the last time, and when the journal closes. The file is locked while a sweep uses it.
"""

from __future__ import annotations

import fcntl
import json
import os
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple, cast, get_args

from outrider.errors import InputError, OutriderError
from outrider.sweep.sources import differences
from outrider.sweep.tasks import Entry, Status

FORMAT = 1
SYNC_S = 1.0


class Header(NamedTuple):
    """First line of a journal.

    It has the name of the sweep, the hash of all its cells, and the versions that it was flown with.
    """

    name: str
    sweep: str
    versions: dict[str, str]


class Journal:
    """Open, locked journal. ``entries`` holds the latest entry of each run, in no particular order."""

    def __init__(self, descriptor: int, path: Path, entries: dict[tuple[str, int], Entry]) -> None:
        self._descriptor = descriptor
        self._path = path
        self._synced = time.monotonic()
        self._dirty = False
        self.entries = entries

    def append(self, entry: Entry) -> None:
        """Write the line of a run that has ended or was lost.

        Raises OutriderError if the line was written only in part, and OSError if it could not be written.
        """
        _write(self._descriptor, self._path, {"run": entry._asdict()})
        self.entries[entry.run] = entry
        self._dirty = True
        self.settle()

    def settle(self, at_once: bool = False) -> None:
        """Flush written lines to the disk, if it is time or ``at_once`` is set."""
        now = time.monotonic()
        if self._dirty and (at_once or now - self._synced >= SYNC_S):
            os.fsync(self._descriptor)
            self._synced, self._dirty = now, False


@contextmanager
def opened(path: Path, header: Header) -> Iterator[Journal]:
    """Open the journal at ``path``, or create it.

    Raises InputError if it is in use, belongs to another sweep or other versions, or is damaged before its
    end; then it is left unchanged.
    """
    try:
        descriptor = os.open(path, os.O_RDWR | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC, 0o644)
    except OSError as error:
        raise InputError(f"{path}: cannot be opened: {error.strerror}") from None
    try:
        _lock(descriptor, path)
        data = path.read_bytes()
        whole = data.rfind(b"\n") + 1
        entries = _read(data[:whole], path, header)
        if whole < len(data):
            os.ftruncate(descriptor, whole)
        if whole == 0:
            _write(descriptor, path, {"journal": FORMAT, **header._asdict()})
        os.fsync(descriptor)
        journal = Journal(descriptor, path, entries)
        try:
            yield journal
        finally:
            journal.settle(at_once=True)
    finally:
        os.close(descriptor)


def _lock(descriptor: int, path: Path) -> None:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        raise InputError(
            f"{path.parent}: another sweep is running in this directory; allowed: one at a time"
        ) from None


def _write(descriptor: int, path: Path, line: Mapping[str, object]) -> None:
    data = json.dumps(line, allow_nan=False, separators=(",", ":")).encode() + b"\n"
    written = os.write(descriptor, data)
    if written != len(data):
        # The incomplete line is removed on resume; nothing may be written after it.
        raise OutriderError(f"{path}: took only {written} of {len(data)} bytes; is the disk full?")


def _read(data: bytes, path: Path, header: Header) -> dict[tuple[str, int], Entry]:
    lines = data.split(b"\n")[:-1]
    if not lines:
        return {}
    _check(_parse(lines[0], path, 1), path, header)
    entries: dict[tuple[str, int], Entry] = {}
    for number, line in enumerate(lines[1:], 2):
        entry = _entry(_parse(line, path, number).get("run"))
        if entry is None:
            raise _damaged(path, number)
        entries[entry.run] = entry
    return entries


def _check(first: dict[str, Any], path: Path, header: Header) -> None:
    if first.get("journal") != FORMAT:
        raise InputError(
            f"{path}:1: is no journal of format {FORMAT}; allowed: one that this version wrote, or another "
            "--out"
        )
    if first.get("sweep") != header.sweep:
        raise InputError(
            f"{path}:1: is of another sweep ({first.get('name')}): its cells are not those of {header.name}; "
            "allowed: the sweep that began it, or another --out"
        )
    before = first.get("versions")
    if before != header.versions:
        changed = differences(before if isinstance(before, dict) else {}, header.versions, "now")
        raise InputError(
            f"{path}:1: was flown with {', '.join(changed)}; its runs and new ones cannot be mixed; allowed: "
            "the same versions, or another --out"
        )


def _parse(line: bytes, path: Path, number: int) -> dict[str, Any]:
    try:
        value = json.loads(line)
    except (ValueError, RecursionError):
        raise _damaged(path, number) from None
    if not isinstance(value, dict):
        raise _damaged(path, number)
    return value


def _entry(value: object) -> Entry | None:
    """Return the entry of a line, or None if it is invalid."""
    match value:
        case {
            "key": str(key),
            "seed": int(seed),
            "status": str(status),
            "what": None | str() as what,
            "summary": None | dict() as summary,
            "wall_s": int() | float() as wall_s,
        } if status in get_args(Status) and (status == "done") == (summary is not None):
            return Entry(key, seed, cast("Status", status), what, summary, float(wall_s))
    return None


def _damaged(path: Path, number: int) -> InputError:
    return InputError(
        f"{path}:{number}: is damaged, although only the last line may be incomplete; allowed: a whole "
        "journal, or another --out"
    )
