"""Plan of a trial of certified separation: vehicles, clocks, losses, and what happens to which process."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import Any, Final

import yaml

from companion.avoidance.certified.margins import between
from companion.config.certified import CertifiedConfig
from companion.config.planning import FieldConfig, LimitsConfig
from trials.autopilots import Autopilot
from trials.plan import FLAVOURS, TARGET

MIXED: Final = "mixed"
KINDS: Final = (*FLAVOURS, MIXED)
PROCESSES: Final = ("companion", "parent", "backup node")
"""Processes of ``outrider fly`` that may be killed or stopped."""
SPACING: Final = 6.0
"""Distance between two vehicles at the start (m), if plans may be a metre nearer."""
TUBE: Final = 1.0
"""Largest tracking error that plans allow for by default (m)."""
SIGMA: Final = 0.02
"""Standard deviation of the position estimates by default (m)."""
STOP_S: Final = 3.0
"""Time for which a process is stopped (s)."""
_ORIGIN: Final = {"latitude": 47.397742, "longitude": 8.545594, "altitude": 488.0}
_HEIGHT: Final = 6.0
_V_MAX: Final = (2.0, 2.0, 1.0)
_CLOCK_US: Final = 40_000


@dataclass(frozen=True)
class CertifiedPlan:
    """Trial of ``count`` vehicles of ``kind`` that swap places; all random choices follow from ``seed``.

    ``victims``: kinds of processes of which one is killed and one stopped. ``offset_ms``, ``drift_ppm``:
    bounds of the errors of the companions' clocks.
    """

    kind: str = FLAVOURS[0]
    count: int = 5
    seed: int = 1
    loss: float = 0.2
    offset_ms: float = 5000.0
    drift_ppm: float = 50.0
    victims: tuple[str, ...] = PROCESSES
    """Empty: nothing happens to any process."""
    seconds: float = 45.0
    """Time from the first goals to the end (s)."""
    d_min: float = 0.5
    tube: float = TUBE
    """Largest tracking error that the plans allow for (m)."""
    position_sigma: float = SIGMA
    """Standard deviation of the position estimates (m)."""
    signed: bool = False
    """Whether all links are signed with one key."""
    sensors: str = "truth"
    """Error of the position estimates of emulated vehicles; their reported positions are judged."""
    autopilots: tuple[Autopilot, ...] = ()
    """Simulations of real firmware that fly instead of ``count`` emulated vehicles of ``kind``."""
    random: Random = field(init=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "random", Random(f"certified {self.kind} {self.seed}"))

    @property
    def systems(self) -> range:
        """System ids of the vehicles."""
        return range(1, len(self.autopilots or (None,) * self.count) + 1)

    @property
    def name(self) -> str:
        """Kind of the vehicles."""
        if not self.autopilots:
            return self.kind
        kinds = {one.flavour for one in self.autopilots}
        return f"real-{min(kinds) if len(kinds) == 1 else MIXED}"

    @property
    def distance(self) -> float:
        """Least distance between two plans (m)."""
        return between(
            CertifiedConfig(tube=self.tube, clock_us=_CLOCK_US),
            FieldConfig(d_min=self.d_min, position_sigma=self.position_sigma),
            LimitsConfig(v_max=_V_MAX),
        )

    @property
    def spacing(self) -> float:
        """Distance between two vehicles at the start, and between two goals (m)."""
        return max(SPACING, self.distance + 1.0)

    @property
    def origin(self) -> dict[str, float]:
        """Origin of the fleet frame, below the first vehicle."""
        return _ORIGIN

    def flavour_of(self, system: int) -> str:
        """Return the flavour of that vehicle's autopilot."""
        if self.autopilots:
            return self.autopilots[system - 1].flavour
        return FLAVOURS[system % 2] if self.kind == MIXED else self.kind

    def start(self, system: int) -> tuple[float, float, float]:
        """Return the place at which that vehicle flies first: east, north, up (m)."""
        return (self.spacing * (system - 1), 0.0, _HEIGHT)

    def goal(self, system: int, turn: int) -> tuple[float, float, float]:
        """Return its goal in ``turn`` 0, 1, …: the mirrored place of the row, and back, further north."""
        other = len(self.systems) + 1 - system if turn % 2 == 0 else system
        return (self.spacing * (other - 1), 3.0 * (turn + 1), _HEIGHT)

    def document(self, system: int, random: Random) -> dict[str, Any]:
        """Return the companion's file of that vehicle, with a clock drawn from ``random``."""
        width = self.spacing * len(self.systems)
        error = {
            "offset_ms": round(random.uniform(-self.offset_ms, self.offset_ms), 3),
            "drift_ppm": round(random.uniform(-self.drift_ppm, self.drift_ppm), 3),
        }
        return {
            "system": system,
            "target": TARGET,
            "origin": self.origin,
            "takeoff_height": _HEIGHT,
            "clock": "wall",
            "clock_error": error,
            "period_us": 20_000,
            "companion": {
                "task": "goto",
                "tracking": {"compensate": True},
                "avoidance": "certified",
                "limits": {
                    "u_max": [1.5, 1.5, 1.0],
                    "v_max": list(_V_MAX),
                    "j_max": [3.5, 3.5, 3.5],
                    "box_min": [-width, -width, 2.5],
                    "box_max": [2 * width, 2 * width, 30.0],
                },
                "field": {"d_min": self.d_min, "position_sigma": self.position_sigma},
                "guard": {"fence_radius": 200.0, "fence_height": 50.0, "tube": 3.0},
                "certified": {
                    "fleet": list(self.systems),
                    "fleet_time": "measured",
                    "clock_us": _CLOCK_US,
                    "tube": self.tube,
                    "time_sources": {"reference": 1},
                },
                "rates": {"setpoint_us": 40_000},
            },
        }

    def write(self, place: Path) -> dict[int, Path]:
        """Write the companions' files to ``place``; return the paths by system id."""
        paths = {}
        for system in self.systems:
            path = paths[system] = place / f"companion-{system}.yaml"
            path.write_text(yaml.safe_dump(self.document(system, self.random), sort_keys=False))
        return paths
