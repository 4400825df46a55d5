"""What follows when something is wrong, at once or as soon as it can."""

from __future__ import annotations

from companion.flight.health_monitor import Change, Reaction
from companion.flight.state_machine import Pilot
from companion.values.phase import STEERED


class Reactions:
    """Owed to the concerns that began and are not over; a reaction itself outlives its concern."""

    def __init__(self) -> None:
        self._owed: dict[str, Reaction] = {}

    def note(self, change: Change) -> None:
        """A concern that began or ended."""
        concern = change.concern
        if not change.begins:
            self._owed.pop(concern.name, None)
        elif concern.reaction is not Reaction.TELL:
            self._owed[concern.name] = concern.reaction

    def follow(self, pilot: Pilot) -> None:
        """Tell the ``pilot`` the gravest. What began on the way up, or while somebody else had the vehicle,
        waits until it is steered."""
        if not self._owed or pilot.phase not in STEERED:
            return
        if Reaction.LAND in self._owed.values():
            pilot.alight()
        else:
            pilot.come_back()
        self._owed.clear()
