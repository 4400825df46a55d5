"""Summary of a flight, as numbers for scripts."""

from __future__ import annotations

from pathlib import Path

from companion.flight.autopilots.known import KNOWN
from outrider.onboard.flight import Flight

_NUMBER = 1
"""Index of MAV_AUTOPILOT in ``State.beat``."""


def summary(flight: Flight, directory: Path) -> dict[str, object]:
    """Return the summary as one JSON object.

    The fields that the worker reports when it ends are absent if it was killed; ``state`` is its last state.
    """
    asked, state, event_log = flight.asked, flight.state, flight.event_log
    profile = None if state.beat is None else KNOWN.get(state.beat[_NUMBER])
    return {
        "system": asked.system,
        "autopilot": None if profile is None else profile.name,
        "dry_run": asked.dry_run,
        "signed": asked.key is not None,
        "ended": flight.ended,
        "fault": flight.fault,
        "restarts": [{"wall_s": lost, "why": why} for lost, why in flight.restarts],
        "last_word": flight.last_word or None,
        "landed_off_m": None if flight.landing.off is None else round(flight.landing.off, 2),
        "phases": [{"phase": phase, "wall_s": began} for phase, began in event_log.phases],
        "concerns": dict(event_log.concerns),
        **flight.figures,
        "clock_steps": state.clock_steps,
        "state": state._asdict(),
        "wall_s": round(flight.seconds, 2),
        "run_dir": str(directory),
    }
