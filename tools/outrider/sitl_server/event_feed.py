"""Event feed of the vehicles, as text: changes of mode, arming and clients, and status texts."""

from __future__ import annotations

from collections.abc import Iterator

from outrider.logs.flight_modes import mode_name
from outrider.sitl_server.request import Request
from outrider.sitl_server.shared_page import MAX_TEXTS, SharedPage, VehicleSnapshot


class EventFeed:
    """Feed of differences between polls; a UDP client that has left is noticed after 10 s."""

    def __init__(self, asked: Request, board: SharedPage) -> None:
        self._asked, self._board = asked, board
        self._before = [VehicleSnapshot() for _ in range(asked.count)]

    def look(self) -> list[str]:
        """Return one line (s since boot, vehicle, event) for each change and new text since the last call.

        Only the latest ``MAX_TEXTS`` texts of a vehicle are available.
        """
        lines = []
        for index, system in enumerate(self._asked.systems):
            now = self._board.snapshot(index)
            if now.up:
                what = self._changes(index, self._before[index], now)
                lines += [f"{now.time:8.1f} s  vehicle {system}: {one}" for one in what]
                self._before[index] = now
        return lines

    def _changes(self, index: int, before: VehicleSnapshot, now: VehicleSnapshot) -> Iterator[str]:
        first = max(before.said, now.said - MAX_TEXTS)
        for number in range(first, now.said):
            yield f"says {self._board.saying(index, number)!r}"
        if before.up and now.custom_mode != before.custom_mode:
            yield f"mode {mode_name(self._asked.flavour, now.custom_mode)}"
        if now.armed != before.armed:
            yield "armed" if now.armed else "disarmed"
        if now.clients != before.clients:
            yield f"{now.clients} client{'' if now.clients == 1 else 's'}"
