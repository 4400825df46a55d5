"""Words that the operator types, as commands to the companion (COMMAND_LONG)."""

from __future__ import annotations

from difflib import get_close_matches

from companion.flight.command_protocol import ACCEPTED
from companion.flight.orders import NAV_LOITER_UNLIM, NAV_RETURN
from companion.flight.state_machine import NAV_LAND, NAV_TAKEOFF
from companion.telemetry.reception import LINKS
from companion.values.components import COMPONENT
from mavlink_bridge.messages import CommandLong, Source
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.signing import Signing

OPERATOR = 190
"""MAV_COMP_ID_MISSIONPLANNER, under the vehicle's own system id: no ground station's."""
QUIT = "quit"
_COMMANDS = {"go": NAV_TAKEOFF, "hold": NAV_LOITER_UNLIM, "return": NAV_RETURN, "land": NAV_LAND}
WORDS = (*_COMMANDS, QUIT)
_NAN = float("nan")


class Orders:
    """Makes frames of words; ``height``: m above the ground, of a go. ``signing``: its own."""

    def __init__(self, system: int, height: float, signing: Signing | None = None) -> None:
        self._system, self._height = system, height
        self._codec = Codec(None, signing, LINKS.index("ground"))

    def frame(self, word: str) -> bytes:
        """One of ``WORDS`` but to quit."""
        params = (0.0, 0.0, 0.0, _NAN, _NAN, _NAN, self._height if word == "go" else 0.0)
        source = Source(self._system, OPERATOR)
        return self._codec.encode(CommandLong(source, self._system, COMPONENT, _COMMANDS[word], 0, params))


def answered(command: int, result: int, phase: str, waiting: str) -> str:
    """In words, what the companion makes of an order (COMMAND_ACK); if nothing, in which ``phase`` it is, and
    what it waits for there."""
    word = next((word for word, number in _COMMANDS.items() if number == command), f"command {command}")
    if result == ACCEPTED:
        return f"{word}: taken"
    why = f", waits for {waiting}" if waiting else ""
    return f"{word}: not taken: phase {phase}{why}"


def understood(line: str) -> tuple[str | None, str]:
    """The word of a typed ``line``; or None, and what to say to that, nothing for an empty line."""
    word = line.strip().lower()
    if not word:
        return None, ""
    if word in WORDS:
        return word, ""
    near = get_close_matches(word, WORDS, n=1)
    hint = f"; did you mean {near[0]}?" if near else ""
    return None, f"{word[:20]!r} is no order; allowed: {', '.join(WORDS)}{hint}"
