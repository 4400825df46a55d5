"""One companion for a vehicle on one computer: a second one at the same endpoint is refused."""

from __future__ import annotations

import fcntl
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path

from outrider.errors import InputError


@contextmanager
def berth(system: int, endpoint: str) -> Iterator[None]:
    """That of vehicle ``system`` at ``endpoint``, taken by this process and those that it forks, until the
    last of them has ended. InputError if another one has it."""
    name = sha256(f"{system} {endpoint}".encode()).hexdigest()[:16]
    path = Path(tempfile.gettempdir()) / f"outrider-fly-{os.getuid()}-{name}.lock"
    try:
        file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o600)
    except OSError:
        # No place for it is no reason to stay on the ground.
        yield
        return
    try:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise InputError(
                f"--autopilot {endpoint}: another outrider fly has vehicle {system} there; allowed: one for "
                "each vehicle, and any number with --dry-run"
            ) from None
        yield
    finally:
        os.close(file)
