"""What a client did and saw, as lines of JSON on its standard output: {"what": …, "at": seconds, …}."""

from __future__ import annotations

import json
import math
import sys
import time
from enum import Enum
from typing import Any

_BEGAN = time.monotonic()


def clock() -> float:
    """Seconds since the client began."""
    return time.monotonic() - _BEGAN


def tell(what: str, **facts: Any) -> None:
    """One line. Enums are told by name, objects by their fields, what is no number as null."""
    line = {"what": what, "at": round(clock(), 3), **{name: _plain(value) for name, value in facts.items()}}
    sys.stdout.write(json.dumps(line, allow_nan=False) + "\n")
    sys.stdout.flush()


def _plain(value: Any) -> Any:
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {name: _plain(field) for name, field in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(field) for field in value]
    return value if isinstance(value, int | str | None) else _plain(vars(value))
