"""What a trial is: how many fly what, how fast time goes, and how long each act lasts."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import yaml

from outrider.resources import find

HOST: Final = "127.0.0.1"
TARGET: Final = 100
VEHICLES: Final = 5
FLAVOURS: Final = ("ardupilot", "px4")
_PLAN_US, _SETPOINT_US = 5_000, 50_000
"""µs: of the wall between two plans at least, and of the simulation between two set-points at most."""


@dataclass(frozen=True)
class Plan:
    """Seconds are of the simulation, of which ``speed`` pass in one of the wall."""

    flavour: str
    speed: float
    escort_s: float = 60.0
    blind_s: float = 10.0
    cut_s: float = 5.0
    pause_s: float = 5.0
    """Between two acts, so that what follows on one is over before the next."""

    @property
    def systems(self) -> range:
        """System ids."""
        return range(1, VEHICLES + 1)

    def settings(self) -> dict[str, Any]:
        """The shipped file of the flavour, with a companion that speaks to the ground."""
        document: dict[str, Any] = yaml.safe_load(
            find("companions", self.flavour).read_text(encoding="utf-8")
        )
        document["target"] = TARGET
        # At the wall's speed, too, it stands whenever the machine is busy.
        document["clock"] = "autopilot"
        companion = document["companion"]
        companion["voice"] = {"texts": True, "values": True}
        # Five companions on two cores have no more plans in them than so many in a second of the wall.
        replan = max(companion["rates"]["replan_us"], round(_PLAN_US * self.speed))
        companion["rates"] = {"replan_us": replan, "setpoint_us": min(replan, _SETPOINT_US)}
        document["period_us"] = min(replan // 2, _SETPOINT_US // 2)
        return document

    def write(self, place: Path) -> Path:
        """The companions' file, in ``place``."""
        path = place / "companion.yaml"
        path.write_text(yaml.safe_dump(self.settings(), sort_keys=False), encoding="utf-8")
        return path
