"""Commands that show, check or convert recorded flights; ``view`` also shows live ones."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from outrider.commands.options import AsJson
from outrider.errors import InputError


def view(
    sources: Annotated[
        list[str],
        typer.Argument(
            metavar="RUN_DIR|ENDPOINT…", help="What a flight left; or what is listened to: udpin:…, mcast:, …"
        ),
    ],
    host: Annotated[str, typer.Option(help="Interface to serve the page at.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=1, max=65535, help="Or the next that is free.")] = 8080,
    target: Annotated[int, typer.Option(min=1, max=255, help="System id of what is escorted.")] = 10,
    html: Annotated[
        Path | None,
        typer.Option(help="Write the run as one file that plays anywhere, and end."),
    ] = None,
    seconds: Annotated[float | None, typer.Option(min=0.0, help="End after so many s.")] = None,
) -> None:
    """Show vehicles in the browser in 3D: a recorded run, or a live flight, to which nothing is sent."""
    from outrider.view.command import Terms
    from outrider.view.command import view as viewing

    raise typer.Exit(viewing(sources, Terms(host, port, target, html, seconds)))


def replay(
    log: Annotated[
        Path,
        typer.Argument(metavar="LOG", help="A tlog, or what a flight left: logs and configuration.yaml."),
    ],
    listing: Annotated[
        bool, typer.Option("--list", help="Show who is in the log, and what is damaged.")
    ] = False,
    certify: Annotated[
        bool,
        typer.Option(
            "--certify",
            help="Check from the transmitted plans that all vehicles kept their distance from each other and "
            "from fixed obstacles.",
        ),
    ] = False,
    own: Annotated[int | None, typer.Option(min=1, max=255, help="The own vehicle's system id.")] = None,
    neighbours: Annotated[
        str | None, typer.Option(help="The neighbours' system ids, separated by commas.")
    ] = None,
    target: Annotated[int | None, typer.Option(min=1, max=255, help="The target's system id.")] = None,
    like: Annotated[str, typer.Option(help="Scenario whose companions' settings count.")] = "escort",
    speed: Annotated[float | None, typer.Option(min=0.01, max=1000.0, help="Times the log's own.")] = None,
    to: Annotated[str | None, typer.Option(help="Endpoint for the log's telemetry; no commands.")] = None,
    out: Annotated[Path | None, typer.Option(help="Directory; new or empty.")] = None,
    as_json: AsJson = False,
) -> None:
    """Replay a log, or check a flight from its log.

    With --own: what would a companion have sent? With --target: fly own vehicles around a recorded target.
    For a run of outrider: does each companion, given what it received, send the same messages again? Exits
    with 1 if not, or if there are findings.
    """
    if listing and certify:
        raise InputError(f"replay {log}: both at once; allowed: one of --list, --certify")
    others = {"own": own, "neighbours": neighbours, "target": target, "speed": speed, "to": to, "out": out}
    for name in [name for name, value in others.items() if value is not None] if listing or certify else ():
        raise InputError(f"replay {log}: --{name} does not go with {'--list' if listing else '--certify'}")
    if listing:
        from outrider.logs.listing import listing as naming

        raise typer.Exit(naming(log, as_json))
    if certify:
        from outrider.certify.command import certify as certifying

        raise typer.Exit(certifying(log, as_json))
    from outrider.replay.request import Request

    request = Request(log, own, neighbours, target, like, speed, to, out, as_json)
    raise typer.Exit(request.run())


def export(
    source: Annotated[Path, typer.Argument(help="What a flight left, or a tlog.", metavar="RUN_DIR|LOG")],
    form: Annotated[str, typer.Option("--format", help="mcap, csv, parquet or ulog.")],
    out: Annotated[Path | None, typer.Option(help="File (mcap) or directory; new.")] = None,
    as_json: AsJson = False,
) -> None:
    """Convert a run or a log into files for Foxglove, PlotJuggler, tables or PX4's tools."""
    from outrider.export.command import export as exporting

    exporting(source, form, out, as_json)


def report(
    run_dir: Annotated[Path, typer.Argument(help="What a flight left.")],
    out: Annotated[Path | None, typer.Option(help="The page; by default RUN_DIR/report.html.")] = None,
    as_json: AsJson = False,
) -> None:
    """Make one HTML page of a run: summary, replay, charts, events and message loss. It needs no network."""
    from outrider.report.command import report as reporting

    raise typer.Exit(reporting(run_dir, out, as_json))
