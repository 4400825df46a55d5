"""Instance lock: one companion for each vehicle and autopilot endpoint on one computer; a second is refused.

The lock is a file in a folder of the user. Its name depends on the network namespace, because the same port
in another namespace is another endpoint; a serial port is the same in all namespaces.
"""

from __future__ import annotations

import fcntl
import os
import shlex
import stat
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from hashlib import sha256
from pathlib import Path
from typing import Final

from mavlink_bridge.links.endpoints import Endpoint, Serial
from outrider.errors import InputError

_MAX_COMMAND_CHARACTERS: Final = 200
"""Longest part of a command line that is shown (characters)."""
_MAX_PID_DIGITS: Final = 10
"""Maximum number of digits of a process id."""


@contextmanager
def instance_lock(system: int, endpoint: Endpoint) -> Iterator[None]:
    """Hold the lock of vehicle ``system`` at ``endpoint``.

    This process and the processes that it forks hold it until the last of them has ended. Raises InputError,
    which names the holder, if another process holds the lock. If the lock file cannot be opened, there is no
    lock.
    """
    place = "" if isinstance(endpoint, Serial) else _network()
    name = sha256(f"{place} {system} {endpoint}".encode()).hexdigest()[:16]
    try:
        path = _folder() / f"fly-{name}.lock"
        file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
    except OSError:
        # A lock file that cannot be opened is no reason not to fly.
        yield
        return
    try:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise InputError(
                f"--autopilot {endpoint}: another outrider fly has vehicle {system} there{_holder(file)}; "
                "allowed: one for each vehicle, and any number with --dry-run"
            ) from None
        _write_holder(file)
        yield
    finally:
        os.close(file)


def _folder() -> Path:
    """Return the lock folder.

    It is below XDG_RUNTIME_DIR if only this user may enter that; if not, below the temporary directory.
    Raises OSError if another user owns the folder or may enter it.
    """
    given = os.environ.get("XDG_RUNTIME_DIR", "")
    if os.path.isabs(given) and _is_private(Path(given)):
        folder = Path(given) / "outrider"
    else:
        folder = Path(tempfile.gettempdir()) / f"outrider-{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    if not _is_private(folder):
        raise PermissionError(f"{folder} is not this user's alone")
    return folder


def _is_private(folder: Path) -> bool:
    """Return whether ``folder`` is a folder of this user that no other user may enter."""
    try:
        found = folder.lstat()
    except OSError:
        return False
    return stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid() and not found.st_mode & 0o077


def _network() -> str:
    """Return an id of this process's network namespace, empty where the system has none."""
    try:
        found = os.stat("/proc/self/ns/net")
    except OSError:
        return ""
    return f"{found.st_dev}:{found.st_ino}"


def _write_holder(file: int) -> None:
    """Write process id and command line of the holder; on a full disk the lock holds without them."""
    program, *arguments = sys.argv or [""]
    with suppress(OSError):
        os.ftruncate(file, 0)
        command = shlex.join([Path(program).name.replace("__main__.py", "outrider"), *arguments])
        os.pwrite(file, f"{os.getpid()} {command}\n".encode(errors="replace"), 0)


def _holder(file: int) -> str:
    """Return a description of the holding process from the lock file; empty if it cannot be read."""
    try:
        said = os.pread(file, 4096, 0).decode(errors="replace").strip()
    except OSError:
        return ""
    number, _, command = said.partition(" ")
    if not (number.isascii() and number.isdigit()) or len(number) > _MAX_PID_DIGITS:
        return ""
    command = "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in command)[
        :_MAX_COMMAND_CHARACTERS
    ]
    ended = "" if _alive(int(number)) else "a process that was started by "
    return f" ({ended}process {number}{f': {command}' if command else ''})"


def _alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True
