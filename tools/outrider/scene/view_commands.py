"""Commands of the view's user to a simulation.

Each message holds all present commands and is repeated, so that the loss of a message has no lasting effect.
"""

from __future__ import annotations

import json
import math
from typing import NamedTuple

from companion.config.planning import MethodName
from outrider.scenarios.options import METHODS

FASTEST = 100.0
"""Largest speed that can be commanded, as a multiple of real time."""
LOSSY = ("swarm", "target")
"""Links on which the commanded loss applies, as with ``--loss``."""
_MAX_COORDINATE_M = 10_000.0
"""m"""
_MAX_COUNT = 1 << 31
_MAX_BYTES = 4096
"""Bytes."""


class ViewCommands(NamedTuple):
    """Commands of the view's user.

    ``speed``: multiple of real time, None for as fast as possible; ``paused``; ``steps``: number of requested
    single steps. ``methods`` joined by + and ``loss`` (0…1): None leaves the present value. ``target`` (3,)
    m, fleet-local ENU: last position to which the user moved the target; ``moves``: number of these moves.
    """

    speed: float | None = None
    paused: bool = False
    steps: int = 0
    methods: str | None = None
    loss: float | None = None
    target: tuple[float, float, float] | None = None
    moves: int = 0

    @property
    def method_names(self) -> tuple[MethodName, ...]:
        """``methods`` as a companion takes them."""
        asked = (self.methods or "").split("+")
        return tuple(name for name in METHODS if name in asked)


def encoded(commands: ViewCommands) -> bytes:
    """Encode ``commands`` for ``decoded``."""
    return json.dumps(commands._asdict()).encode()


def decoded(data: bytes) -> ViewCommands | None:
    """Decode the result of ``encoded``; return None for anything else."""
    if len(data) > _MAX_BYTES:
        return None
    try:
        found = json.loads(data)
        place = found.get("target")
        commands = ViewCommands(**{**found, "target": None if place is None else tuple(place)})
    except (ValueError, TypeError, AttributeError, RecursionError):
        return None
    return commands if _sensible(commands) else None


def _sensible(commands: ViewCommands) -> bool:
    speed, loss, target, methods = commands.speed, commands.loss, commands.target, commands.methods
    return (
        (speed is None or (_number(speed) and 0.0 < speed <= FASTEST))
        and isinstance(commands.paused, bool)
        and all(type(count) is int and 0 <= count < _MAX_COUNT for count in (commands.steps, commands.moves))
        and (methods is None or (isinstance(methods, str) and set(methods.split("+")) <= set(METHODS)))
        and (loss is None or (_number(loss) and 0.0 <= loss <= 1.0))
        and (
            target is None
            or (len(target) == 3 and all(_number(x) and abs(x) < _MAX_COORDINATE_M for x in target))
        )
    )


def _number(value: object) -> bool:
    return type(value) in (int, float) and math.isfinite(float(value))  # type: ignore[arg-type]
