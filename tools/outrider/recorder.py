"""Writes the tlogs of a run."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import ExitStack
from pathlib import Path

from mavlink_bridge.node import Datagram
from mavlink_bridge.runtime import Direction
from mavlink_bridge.tlog import TlogWriter
from outrider import names


class Recorder:
    """A tap: one tlog in ``directory`` for each vehicle of ``systems``, with all that its companion received
    and sent, at the times at which it handled it. ``files`` closes them."""

    def __init__(self, directory: Path, systems: Iterable[int], files: ExitStack) -> None:
        self._writers = {
            names.companion(s): files.enter_context(TlogWriter(directory / names.log(s))) for s in systems
        }

    def __call__(self, now: int, node: str, _direction: Direction, datagram: Datagram, /) -> None:
        writer = self._writers.get(node)
        if writer is not None:
            writer.write(now, names.LINK_NUMBERS[datagram.link], datagram.data)
