"""What a trial is: how many fly what, what happens to them, and how fast time goes."""

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
"""µs: of the wall between two plans at least, and of the simulation between two set-points at most."""
ROW: Final = 5.0
"""m between vehicles that stand in a row, towards the east, from the origin on."""


@dataclass(frozen=True)
class Plan:
    """Seconds are of the simulation, of which ``speed`` pass in one of the wall. Without ``autopilots`` five
    emulated ones of ``flavour`` fly; ``origin``: of the fleet frame, if not that of the shipped files."""

    flavour: str
    speed: float
    story: str = MISHAPS
    autopilots: tuple[Autopilot, ...] = ()
    origin: Origin | None = None
    escort_s: float = 60.0
    blind_s: float = 10.0
    cut_s: float = 5.0
    pause_s: float = 5.0
    """Between two acts, so that what follows on one is over before the next."""
    run_s: float = 25.0
    """For which the target of a sortie runs."""

    @property
    def systems(self) -> range:
        """System ids."""
        return range(1, len(self.autopilots or (None,) * USUAL) + 1)

    @property
    def name(self) -> str:
        """What flies what."""
        flown = [self.flavour_of(system) for system in self.systems]
        if not self.autopilots:
            return f"{self.flavour}, emulated, {self.story} ×{self.speed:g}"
        kinds = " and ".join(f"{flown.count(kind)} {kind}" for kind in FLAVOURS if kind in flown)
        return f"{kinds}, {self.story}"

    def flavour_of(self, system: int) -> str:
        """What that vehicle's autopilot is."""
        return self.autopilots[system - 1].flavour if self.autopilots else self.flavour

    def settings(self, flavour: str) -> dict[str, Any]:
        """The shipped file of the flavour, with a companion that speaks to the ground."""
        document: dict[str, Any] = yaml.safe_load(find("companions", flavour).read_text(encoding="utf-8"))
        document["target"] = TARGET
        companion = document["companion"]
        companion["voice"] = {"texts": True, "values": True}
        if self.origin is not None:
            document["origin"] = self.origin.model_dump()
        if not self.autopilots:
            # At the wall's speed, too, it stands whenever the machine is busy.
            document["clock"] = "autopilot"
            # Five companions on two cores have no more plans in them than so many in a second of the wall.
            replan = max(companion["rates"]["replan_us"], round(_PLAN_US * self.speed))
            companion["rates"] = {"replan_us": replan, "setpoint_us": min(replan, _SETPOINT_US)}
            document["period_us"] = min(replan // 2, _SETPOINT_US // 2)
        return document

    def write(self, place: Path) -> dict[str, Path]:
        """The companions' file of each flavour, in ``place``."""
        paths = {}
        for flavour in {self.flavour_of(system) for system in self.systems}:
            path = paths[flavour] = place / f"companion-{flavour}.yaml"
            path.write_text(yaml.safe_dump(self.settings(flavour), sort_keys=False), encoding="utf-8")
        return paths
