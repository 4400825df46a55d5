"""Terms and phases of a check of one vehicle; values only."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from companion.config import CompanionConfig
from outrider.preflight.course import Box
from outrider.preflight.tube import TrackingError
from outrider.scenarios.fly_config import FleetOrigin


class Phase(Enum):
    """Phase of the check."""

    WAIT = "waiting"
    MEASURE = "measuring"
    TURNS = "flying alone"
    EXCHANGE = "exchanging reports"
    OVER = "done"


@dataclass(frozen=True)
class FlightTerms:
    """Terms of the flight alone.

    ``target``: system id of the target, which is not used; ``height`` (m): of the take-off; ``go``: whether
    the operator's go was given before; ``dry``: nothing flies.
    """

    target: int
    height: float
    box: Box
    go: bool = False
    dry: bool = False


@dataclass(frozen=True)
class Terms:
    """Terms of a check: ``config`` has the roster as ``certified.fleet``.

    ``seconds``: duration of the measurement; ``wait_s``: longest time to wait for the others. ``run``: random
    number (32 bits) of this process. ``flown``: tracking error of the vehicle in a recorded flight. ``fly``:
    terms of the flight alone; None: nothing flies.
    """

    system: int
    config: CompanionConfig
    origin: FleetOrigin
    seconds: float
    wait_s: float
    run: int
    flown: TrackingError | None = None
    fly: FlightTerms | None = None

    @property
    def others(self) -> tuple[int, ...]:
        """System ids of the others, sorted."""
        return tuple(sorted(set(self.config.certified.fleet) - {self.system}))
