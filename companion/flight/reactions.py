"""Reactions to concerns, executed at once or as soon as possible."""

from __future__ import annotations

from companion.flight.health_monitor import Change, Reaction
from companion.flight.state_machine import Pilot
from companion.values.phase import STEERED


class Reactions:
    """Pending reactions to present concerns; a reaction in progress outlives its concern."""

    def __init__(self) -> None:
        self._owed: dict[str, Reaction] = {}

    def note(self, change: Change) -> None:
        """Record a concern that began or ended."""
        concern = change.concern
        if not change.begins:
            self._owed.pop(concern.name, None)
        elif concern.reaction is not Reaction.TELL:
            self._owed[concern.name] = concern.reaction

    def follow(self, pilot: Pilot) -> None:
        """Order the most severe pending reaction.

        If the concern began during the take-off, or while another controller had the vehicle, its reaction
        waits until the companion steers.
        """
        if not self._owed or pilot.phase not in STEERED:
            return
        if Reaction.LAND in self._owed.values():
            pilot.alight()
        else:
            pilot.come_back()
        self._owed.clear()
