"""Commands that run many flights."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from outrider.commands.options import AsJson, Begun, Jobs, shipped

Scheduler = Annotated[
    str | None,
    typer.Option(metavar="ADDRESS", help="Fly on the workers of a Dask scheduler: tcp://HOST:PORT."),
]
WallLimit = Annotated[float, typer.Option(min=1.0, help="Maximum wall time of one run, s.")]


def sweep(
    name: Annotated[
        str,
        typer.Argument(help="A file, or the name of a shipped sweep.", autocompletion=shipped("sweeps")),
    ],
    runs: Annotated[int | None, typer.Option(min=1, max=1_000_000, help="Seeds per cell.")] = None,
    jobs: Jobs = None,
    out: Begun = None,
    wall_limit: WallLimit = 1800.0,
    scheduler: Scheduler = None,
    regressions: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Write every run that failed there, as a scenario."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Fly many seeds of a grid of scenarios or random scenes. A sweep that was interrupted can be resumed."""
    from outrider.sweep.command import sweep as sweeping

    raise typer.Exit(
        sweeping(name, runs, jobs, out, as_json, wall_limit, scheduler=scheduler, failures=regressions)
    )


def paper(
    seeds: Annotated[int, typer.Option(min=1, max=1000, help="Flights of each row.")] = 10,
    jobs: Jobs = None,
    out: Begun = None,
    as_json: AsJson = False,
    response: Annotated[
        Literal["exact", "firmware"],
        typer.Option(
            help="How autopilots follow set-points: exactly, as in the paper, or as their firmware."
        ),
    ] = "exact",
) -> None:
    """Fly the paper's methods and scenarios, and compare the results with the paper's table."""
    from outrider.paper.command import paper as comparing

    raise typer.Exit(comparing(seeds, jobs, out, as_json, response=response))


def compare(
    name: Annotated[
        str,
        typer.Argument(
            help="A file, or the name of a shipped comparison.", autocompletion=shipped("comparisons")
        ),
    ],
    seeds: Annotated[
        int | None, typer.Option(min=1, max=100_000, help="Flights of each row; by default the file's.")
    ] = None,
    row: Annotated[
        list[str] | None, typer.Option(help="Fly only rows whose label begins so; several times for several.")
    ] = None,
    missions: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Mission files of LSC's planners, in place of drawn missions."),
    ] = None,
    worlds: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="World files (CSV) of LSC's planners, in place of drawn worlds."),
    ] = None,
    physics: Annotated[
        bool,
        typer.Option(
            "--physics", help="With a vehicle in full physics, its limits and distances, in place of points."
        ),
    ] = False,
    jobs: Jobs = None,
    out: Begun = None,
    wall_limit: WallLimit = 1800.0,
    scheduler: Scheduler = None,
    as_json: AsJson = False,
) -> None:
    """Fly the scene of a published planner with its limits, and show ours beside the published figures."""
    from outrider.compare.command import compare as comparing

    chosen = tuple(row or ())
    raise typer.Exit(
        comparing(
            name,
            seeds,
            jobs,
            out,
            as_json,
            chosen,
            missions,
            worlds,
            physics=physics,
            scheduler=scheduler,
            wall_limit_s=wall_limit,
        )
    )


def gallery(
    names: Annotated[
        list[str] | None,
        typer.Argument(metavar="[SCENARIO]...", help="Names of shipped scenarios; by default all."),
    ] = None,
    jobs: Jobs = None,
    out: Begun = None,
    page: Annotated[Path | None, typer.Option(metavar="FOLDER", help="Page and pictures there.")] = None,
) -> None:
    """Fly every method in every scenario, and draw a page of pictures."""
    from outrider.gallery.command import gallery as drawing

    raise typer.Exit(drawing(tuple(names or ()), jobs, out, page))
