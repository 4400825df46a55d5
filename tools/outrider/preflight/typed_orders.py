"""Operator of a flight alone: typed orders and signals."""

from __future__ import annotations

import signal
from collections.abc import Callable, Sequence
from difflib import get_close_matches
from typing import Final

from outrider.errors import OutriderError
from outrider.interruption import ReceivedSignal
from outrider.onboard.line_input import LineInput
from outrider.onboard.orders import QUIT
from outrider.preflight.node import Preflight

STOPS: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
_WORDS: Final = ("go", "land", QUIT)


class TypedOrders:
    """Passes what is ``typed`` to ``node``; raises OutriderError after a signal and the order ``quit``.

    ``say`` shows a line.
    """

    def __init__(
        self,
        node: Preflight,
        typed: LineInput,
        stops: Sequence[ReceivedSignal],
        say: Callable[[str], None],
    ) -> None:
        self._node, self._typed, self._stops, self._say = node, typed, stops, say
        self._asked = False

    def _answer(self, now: int, word: str) -> str:
        """Obey ``word`` at ``now`` (µs); return why not, or an empty string."""
        if word in _WORDS:
            return self._node.order(now, word)
        near = get_close_matches(word, _WORDS, n=1)
        hint = f"; did you mean {near[0]}?" if near else ""
        return f"{word[:20]!r} is no order here; allowed: {', '.join(_WORDS)}{hint}"

    def look(self, now: int) -> None:
        """Do what was ordered at ``now`` (µs), and say when the operator's go is waited for."""
        if self._stops:
            raise OutriderError(f"stopped by {signal.Signals(self._stops[0].which).name}; no fleet file")
        for line in self._typed.lines():
            word = line.strip().lower()
            if word == QUIT:
                raise OutriderError("stopped by the operator; no fleet file")
            if word and (answer := self._answer(now, word)):
                self._say(answer)
        asks = self._node.turns is not None and self._node.turns.asks
        if asks and not self._asked:
            self._say(f"preflight: {self._node.doing}")
        self._asked = asks
