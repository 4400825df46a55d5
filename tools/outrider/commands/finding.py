"""Commands that show what there is to fly and what was flown, and begin a file of one's own."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from outrider.commands.options import AsJson


def listing(
    kind: Annotated[
        str | None,
        typer.Argument(
            help="scenarios, sweeps, scenes, vehicles, cameras, companions or runs; by default all."
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """List shipped scenarios, sweeps, vehicles and other files, and the runs in this folder."""
    from outrider.catalogue.command import show

    raise typer.Exit(show(kind, as_json))


def new(
    path: Annotated[Path, typer.Argument(help="The new file, such as my.yaml.")],
    like: Annotated[str, typer.Option(help="What is copied: a shipped name, or a file.")] = "escort",
    kind: Annotated[
        str, typer.Option(help="scenario, sweep, scene, vehicle, camera or companion.")
    ] = "scenario",
) -> None:
    """Copy a scenario with its comments to a new file, to be edited. Editors find its schema."""
    from outrider.catalogue.command import create

    raise typer.Exit(create(path, like, kind))
