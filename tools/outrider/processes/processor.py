"""Name of the processor, for figures that depend on it."""

from __future__ import annotations

import platform
from pathlib import Path

_CPU_INFO = Path("/proc/cpuinfo")


def processor() -> str:
    """Return the processor's name as the kernel gives it, or else the architecture."""
    try:
        lines = _CPU_INFO.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    names = (line.partition(":")[2].split() for line in lines if line.startswith("model name"))
    return " ".join(next(names, ())) or platform.processor() or platform.machine()
