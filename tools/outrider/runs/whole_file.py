"""Files that are there as a whole, or not at all, or as they were."""

from __future__ import annotations

import os
from pathlib import Path


def write(path: Path, content: str | bytes) -> None:
    """Put ``content`` (text as UTF-8) at ``path`` at once, in place of what is there. OSError if it cannot be
    written; then nothing has changed."""
    new = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        new.write_bytes(content.encode() if isinstance(content, str) else content)
        new.replace(path)
    finally:
        new.unlink(missing_ok=True)
