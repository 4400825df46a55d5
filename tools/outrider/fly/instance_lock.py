"""One companion for a vehicle on one computer: a second one at the same endpoint is refused.

The lock is a file in a folder of the user's own. Its name knows the network namespace, because the same port
in another one is another place; a serial port is the same everywhere.
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

_LONGEST: Final = 200
"""Characters of a command line that are shown."""
_DIGITS: Final = 10
"""Of a process id, at most."""


@contextmanager
def instance_lock(system: int, endpoint: Endpoint) -> Iterator[None]:
    """The lock of vehicle ``system`` at ``endpoint``, held by this process and those that it forks, until the
    last of them has ended. InputError, which names the holder, if another one has it."""
    place = "" if isinstance(endpoint, Serial) else _network()
    name = sha256(f"{place} {system} {endpoint}".encode()).hexdigest()[:16]
    try:
        path = _folder() / f"fly-{name}.lock"
        file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
    except OSError:
        # No place for it is no reason to stay on the ground.
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
        _sign(file)
        yield
    finally:
        os.close(file)


def _folder() -> Path:
    """XDG_RUNTIME_DIR or, where there is none, a folder below the temporary one. OSError if it is somebody
    else's, or open to others."""
    given = os.environ.get("XDG_RUNTIME_DIR", "")
    if os.path.isabs(given) and _own(Path(given)):
        folder = Path(given) / "outrider"
    else:
        folder = Path(tempfile.gettempdir()) / f"outrider-{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    if not _own(folder):
        raise PermissionError(f"{folder} is not this user's alone")
    return folder


def _own(folder: Path) -> bool:
    """Whether it is a folder of this user that nobody else may enter."""
    try:
        found = folder.lstat()
    except OSError:
        return False
    return stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid() and not found.st_mode & 0o077


def _network() -> str:
    """This process's network namespace, empty where the system has none."""
    try:
        found = os.stat("/proc/self/ns/net")
    except OSError:
        return ""
    return f"{found.st_dev}:{found.st_ino}"


def _sign(file: int) -> None:
    """Write down who holds it. A full disk costs the name only."""
    program, *arguments = sys.argv or [""]
    with suppress(OSError):
        os.ftruncate(file, 0)
        command = shlex.join([Path(program).name.replace("__main__.py", "outrider"), *arguments])
        os.pwrite(file, f"{os.getpid()} {command}\n".encode(errors="replace"), 0)


def _holder(file: int) -> str:
    """Which process holds it, as it wrote; empty if that cannot be read."""
    try:
        said = os.pread(file, 4096, 0).decode(errors="replace").strip()
    except OSError:
        return ""
    number, _, command = said.partition(" ")
    if not (number.isascii() and number.isdigit()) or len(number) > _DIGITS:
        return ""
    command = "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in command)[:_LONGEST]
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
