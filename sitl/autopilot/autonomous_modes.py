"""Autonomous flights, without set-points: missions, returning home and following a leader."""

from __future__ import annotations

from typing import Final

from sitl.autopilot.firmware import Mode
from sitl.autopilot.following import Following
from sitl.autopilot.guidance import Guidance
from sitl.autopilot.missions.itinerary import Event, Itinerary, Phase
from sitl.autopilot.returning import Returning
from sitl.config.autopilot import AutopilotConfig
from sitl.estimation.sensors import Estimate

MODES: Final = frozenset((Mode.MISSION, Mode.RETURN, Mode.FOLLOW))


class AutonomousModes:
    """Executor of the modes in ``MODES``."""

    def __init__(
        self, itinerary: Itinerary, returning: Returning, following: Following, guidance: Guidance
    ) -> None:
        self.itinerary = itinerary
        self.following = following
        self._guidance = guidance
        self._returning = returning

    def configure(self, config: AutopilotConfig) -> None:
        """Use new settings from now on."""
        self.itinerary.configure(config)
        self._returning.configure(config)
        self.following.configure(config.follow)

    def begin(self, mode: Mode, here: Estimate) -> None:
        """Start ``mode`` from ``here``; a mission resumes its current item, or restarts if completed."""
        if mode is Mode.RETURN:
            self._returning.begin(here)
        elif mode is Mode.FOLLOW:
            self.following.begin()
        elif self.itinerary.phase is Phase.DONE:
            self.itinerary.rewind()
        else:
            self.itinerary.pause()

    def end(self) -> None:
        """Reset after the motors have stopped."""
        self.itinerary.landed()
        self._returning.end()

    def advance(self, mode: Mode, now: int, here: Estimate) -> Event | None:
        """Continue the flight at ``now`` (µs), if ``mode`` is in ``MODES`` and the guidance is not paused."""
        if self._guidance.paused:
            return None
        if mode is Mode.MISSION:
            return self.itinerary.advance(now, here)
        if mode is Mode.RETURN:
            self._returning.advance(now, here)
        if mode is Mode.FOLLOW:
            self.following.advance(now)
        return None
