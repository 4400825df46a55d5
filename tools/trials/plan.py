"""Plan of a trial: vehicles, story, and speed of time."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import yaml

from outrider.resources import find
from outrider.scenarios.places import Origin
from trials.autopilots import USUAL, Autopilot

HOST: Final = "127.0.0.1"
TARGET: Final = 100
FLAVOURS: Final = ("ardupilot", "px4")
MISHAPS, SORTIE = "mishaps", "sortie"
STORIES: Final = (MISHAPS, SORTIE)
_PLAN_US, _SETPOINT_US = 5_000, 50_000
"""Shortest wall time between two plans, and longest simulated time between two set-points (µs)."""
ROW: Final = 5.0
"""Distance between vehicles that stand in a row, eastward from the origin (m)."""


@dataclass(frozen=True)
class Plan:
    """Plan of a trial.

    Durations are in simulated seconds, ``speed`` of which pass per wall second. Without ``autopilots`` five
    emulated ones of ``flavour`` fly. ``origin``: of the fleet frame, None for that of the shipped files.
    """

    flavour: str
    speed: float
    story: str = MISHAPS
    autopilots: tuple[Autopilot, ...] = ()
    origin: Origin | None = None
    escort_s: float = 60.0
    blind_s: float = 10.0
    cut_s: float = 5.0
    pause_s: float = 5.0
    """Pause between two acts (s), so that the consequences of one are over before the next."""
    run_s: float = 25.0
    """Time for which the target of a sortie runs (s)."""

    @property
    def systems(self) -> range:
        """System ids of the vehicles."""
        return range(1, len(self.autopilots or (None,) * USUAL) + 1)

    @property
    def name(self) -> str:
        """Description of vehicles and story."""
        flown = [self.flavour_of(system) for system in self.systems]
        if not self.autopilots:
            return f"{self.flavour}, emulated, {self.story} ×{self.speed:g}"
        kinds = " and ".join(f"{flown.count(kind)} {kind}" for kind in FLAVOURS if kind in flown)
        return f"{kinds}, {self.story}"

    def flavour_of(self, system: int) -> str:
        """Return the flavour of that vehicle's autopilot."""
        return self.autopilots[system - 1].flavour if self.autopilots else self.flavour

    def settings(self, flavour: str) -> dict[str, Any]:
        """Return the shipped companion file of ``flavour``, with reports to the ground switched on."""
        document: dict[str, Any] = yaml.safe_load(find("companions", flavour).read_text(encoding="utf-8"))
        document["target"] = TARGET
        companion = document["companion"]
        companion["ground_messages"] = {"texts": True, "values": True}
        if self.origin is not None:
            document["origin"] = self.origin.model_dump()
        if not self.autopilots:
            # Even at the wall's speed the simulation pauses whenever the machine is busy.
            document["clock"] = "autopilot"
            # Five companions on two cores cannot compute more plans than this per wall second.
            replan = max(companion["rates"]["replan_us"], round(_PLAN_US * self.speed))
            companion["rates"] = {"replan_us": replan, "setpoint_us": min(replan, _SETPOINT_US)}
            document["period_us"] = min(replan // 2, _SETPOINT_US // 2)
        return document

    def write(self, place: Path) -> dict[str, Path]:
        """Write the companions' file of each flavour to ``place``; return the paths by flavour."""
        paths = {}
        for flavour in {self.flavour_of(system) for system in self.systems}:
            path = paths[flavour] = place / f"companion-{flavour}.yaml"
            path.write_text(yaml.safe_dump(self.settings(flavour), sort_keys=False), encoding="utf-8")
        return paths
