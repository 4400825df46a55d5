"""What a client did and saw, as lines of JSON on its standard output: {"what": …, "at": seconds, …}."""

from __future__ import annotations

import json
import sys
import time
from enum import Enum
from typing import Any

_BEGAN = time.monotonic()


def clock() -> float:
    """Seconds since the client began."""
    return time.monotonic() - _BEGAN


def tell(what: str, **facts: Any) -> None:
    """One line. Enums are told by name, objects by their fields."""
    sys.stdout.write(json.dumps({"what": what, "at": round(clock(), 3), **facts}, default=_plain) + "\n")
    sys.stdout.flush()


def _plain(value: Any) -> Any:
    if isinstance(value, Enum):
        return value.name
    return {name: _plain_enum(field) for name, field in vars(value).items()}


def _plain_enum(value: Any) -> Any:
    # An IntEnum would be told as a number.
    return value.name if isinstance(value, Enum) else value
