"""Orders that the operator types, as commands to the companion (COMMAND_LONG)."""

from __future__ import annotations

from difflib import get_close_matches
from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from companion.telemetry.reception import LINKS
from companion.values.components import COMPONENT
from mavlink_bridge.messages import CommandLong, Message, Source
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.signing import Signing

OPERATOR: Final[int] = mavlink.MAV_COMP_ID_MISSIONPLANNER
"""Component id of the orders' sender; its system id is the vehicle's, which no ground station uses."""
QUIT = "quit"
_COMMANDS = {
    "go": mavlink.MAV_CMD_NAV_TAKEOFF,
    "hold": mavlink.MAV_CMD_NAV_LOITER_UNLIM,
    "return": mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH,
    "land": mavlink.MAV_CMD_NAV_LAND,
}
WORDS = (*_COMMANDS, QUIT)
_NAN = float("nan")


class Orders:
    """Encoder of orders as frames; ``height``: take-off height above ground (m); ``signing``: may be None."""

    def __init__(self, system: int, height: float, signing: Signing | None = None) -> None:
        self._system, self._height = system, height
        self._codec = Codec(None, signing, LINKS.index("ground"))

    def frame(self, word: str) -> bytes:
        """Return the frame for ``word``, one of ``WORDS`` except ``quit``."""
        params = (0.0, 0.0, 0.0, _NAN, _NAN, _NAN, self._height if word == "go" else 0.0)
        source = Source(self._system, OPERATOR)
        return self.encode(CommandLong(source, self._system, COMPONENT, _COMMANDS[word], 0, params))

    def encode(self, message: Message) -> bytes:
        """Return the frame of another order."""
        return self._codec.encode(message)


def answered(command: int, result: int, phase: str, waiting: str) -> str:
    """Return the companion's answer to an order (COMMAND_ACK) as text.

    If the order was not accepted, the text names the current ``phase`` and what the companion waits for.
    """
    word = next((word for word, number in _COMMANDS.items() if number == command), f"command {command}")
    if result == mavlink.MAV_RESULT_ACCEPTED:
        return f"{word}: taken"
    why = f", waits for {waiting}" if waiting else ""
    return f"{word}: not taken: phase {phase}{why}"


def understood(line: str) -> tuple[str | None, str]:
    """Return the word of a typed ``line``; or None and an answer, which is empty for an empty line."""
    word = line.strip().lower()
    if not word:
        return None, ""
    if word in WORDS:
        return word, ""
    near = get_close_matches(word, WORDS, n=1)
    hint = f"; did you mean {near[0]}?" if near else ""
    return None, f"{word[:20]!r} is no order; allowed: {', '.join(WORDS)}{hint}"
