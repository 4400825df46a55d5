"""Recorder of a run: the tlogs, and the step times of the companions."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import ExitStack, closing
from pathlib import Path

from mavlink_bridge.loops.lockstep import Direction
from mavlink_bridge.node import Datagram
from mavlink_bridge.tlog.log import TlogWriter
from outrider.runs import names
from outrider.runs.steps_file import StepsFile


class Recorder:
    """Observer that writes one tlog in ``directory`` for each vehicle of ``systems``.

    The tlog holds all datagrams that the vehicle's companion received and sent, with the times at which it
    handled them. A second file holds the times of its steps. ``files`` closes the files.
    """

    def __init__(self, directory: Path, systems: Iterable[int], files: ExitStack) -> None:
        self._writers: dict[str, TlogWriter] = {}
        self._steps: dict[str, StepsFile] = {}
        for system in systems:
            name = names.companion(system)
            self._writers[name] = files.enter_context(TlogWriter(directory / names.log(system)))
            self._steps[name] = files.enter_context(closing(StepsFile(directory / names.steps(system))))

    def begin(self, now: int, node: str, /) -> None:
        """Record the time of a step of ``node``."""
        steps = self._steps.get(node)
        if steps is not None:
            steps.add(now)

    def __call__(self, now: int, node: str, _direction: Direction, datagrams: Sequence[Datagram], /) -> None:
        """Write the datagrams of ``node`` to its tlog."""
        writer = self._writers.get(node)
        if writer is not None:
            numbers = names.LINK_NUMBERS
            writer.write_all(now, [(numbers[link], data) for link, data in datagrams])
