"""Options that several commands share."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Final

import typer

METHODS: Final = "baseline, swivel, approach_angle, tangential; joined by +."
SENSORS: Final = "truth, rtk, gnss, or sih: as PX4's own simulation."
PHYSICS: Final = "own or jsbsim."
RESPONSE: Final = "exact: at its set-points; firmware: flown by the firmware's position controller."


def shipped(kind: str) -> Callable[[str], list[str]]:
    """Return the completion of the names of shipped files of ``kind``, a folder of the configuration."""

    def complete(incomplete: str) -> list[str]:
        from outrider.resources import config_root

        names = sorted(path.stem for path in (config_root() / kind).glob("*.yaml"))
        return [name for name in names if name.startswith(incomplete)]

    return complete


AsJson = Annotated[bool, typer.Option("--json", help="One JSON object on standard output.")]
Begun = Annotated[Path | None, typer.Option(help="Directory; what was begun there is continued.")]
Jobs = Annotated[int | None, typer.Option(min=1, help="Processes; by default the number of cores.")]
RunDirectory = Annotated[Path | None, typer.Option(help="Run directory; new or empty.")]
SigningKey = Annotated[
    Path | None, typer.Option(help="Key file; only messages signed with it are accepted; see outrider key.")
]
Wind = Annotated[str | None, typer.Option(help="m/s towards east, or EAST,NORTH[,UP].")]
