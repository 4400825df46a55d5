"""The command ``outrider``. Heavy imports wait until a command needs them."""

from __future__ import annotations

import json
import os
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Final, Optional, cast

import typer

from outrider.errors import InputError, OutriderError

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="A ring of MAVs escorts a moving target without colliding.",
)
BAD_INPUT, FAULT = 2, 3
_METHODS: Final = "baseline, swivel, approach_angle, tangential; joined by +."
_INTERRUPTED = 130
"""What typer makes of Ctrl-C."""
_EXTRAS: Final = {
    "numba": "sitl",
    "llvmlite": "sitl",
    "jsbsim": "sitl",
    "mcap": "export",
    "pyarrow": "export",
    "viser": "view",
    "dask": "cluster",
    "distributed": "cluster",
}
"""What only an extra of the package installs."""
# Click's UsageError: typer has no name of its own for it, and newer ones bring their own click.
_UsageError: Final = cast("type[typer.BadParameter]", typer.BadParameter.__base__)


@app.callback()
def _root() -> None:
    """Keeps every command a sub-command."""


@app.command()
def swarm(
    scenario: Annotated[str, typer.Argument(help="A file, or the name of a shipped scenario.")],
    method: Annotated[Optional[str], typer.Option(help=_METHODS)] = None,  # noqa: UP045
    avoidance: Annotated[Optional[str], typer.Option(help="field or certified.")] = None,  # noqa: UP045
    planar: Annotated[bool, typer.Option("--planar", help="Fix the height, as the paper.")] = False,
    vehicles: Annotated[Optional[int], typer.Option(help="How many fly.")] = None,  # noqa: UP045
    seed: Annotated[int, typer.Option(min=0, help="Of jitter, phases and link faults.")] = 1,
    loss: Annotated[Optional[float], typer.Option(min=0.0, max=1.0, help="Share of messages lost.")] = None,  # noqa: UP045
    delay_ms: Annotated[Optional[float], typer.Option(min=0.0, help="Of the swarm and target links.")] = None,  # noqa: UP045
    sensors: Annotated[Optional[str], typer.Option(help="truth, rtk or gnss.")] = None,  # noqa: UP045
    wind: Annotated[Optional[str], typer.Option(help="m/s towards east, or EAST,NORTH[,UP].")] = None,  # noqa: UP045
    replan_hz: Annotated[Optional[float], typer.Option(help="Plans per second.")] = None,  # noqa: UP045
    physics: Annotated[Optional[str], typer.Option(help="own or jsbsim.")] = None,  # noqa: UP045
    real_time: Annotated[
        bool, typer.Option("--real-time", help="Under the wall clock: a process per node, over UDP.")
    ] = False,
    realtime: Annotated[
        bool, typer.Option("--realtime", help="Ask for real-time priority; implies --real-time.")
    ] = False,
    view: Annotated[bool, typer.Option("--view", help="Watch it in the browser (docs/view.md).")] = False,
    out: Annotated[Optional[Path], typer.Option(help="Run directory; new or empty.")] = None,  # noqa: UP045
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on standard output.")] = False,
) -> None:
    """Fly a scenario, in lock-step unless told otherwise, and leave logs, summary and picture in a run
    directory."""
    from outrider import swarm as flying
    from outrider.console import progress, show
    from outrider.report.command import NAME, make, write
    from outrider.summary import exit_status

    options = flying.Options(
        method, avoidance, planar, vehicles, loss, delay_ms, sensors, replan_hz, wind, physics
    )
    prepared = flying.prepare(scenario, options)
    with ExitStack() as open_:
        shown = None
        if view:
            from outrider.viewing.show import showing

            shown = open_.enter_context(showing())
        directory = flying.run_directory(out, prepared.scenario, seed)
        with progress(prepared.scenario.duration_s) as watch:
            pace = flying.Pace(real_time or realtime, realtime)
            summary = flying.fly(prepared, seed, directory, watch, pace, shown)
        write(directory / NAME, make(directory).text)
        if as_json:
            sys.stdout.write(json.dumps(summary) + "\n")
            sys.stdout.flush()
        else:
            show(summary)
        if shown is not None:
            shown.stay(directory)
    raise typer.Exit(exit_status(summary))


@app.command()
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
        Optional[Path],  # noqa: UP045
        typer.Option(help="Write the run as one file that plays anywhere, and end."),
    ] = None,
    seconds: Annotated[Optional[float], typer.Option(min=0.0, help="End by itself after that.")] = None,  # noqa: UP045
) -> None:
    """Show vehicles in the browser, in three dimensions: a run that is played, or a live flight that is
    listened to; nothing is sent there."""
    from outrider.viewing.command import Terms
    from outrider.viewing.command import view as viewing

    raise typer.Exit(viewing(sources, Terms(host, port, target, html, seconds)))


@app.command()
def sitl(
    count: Annotated[int, typer.Option(min=1, max=254, help="Vehicles.")] = 1,
    flavour: Annotated[str, typer.Option(help="ardupilot or px4.")] = "ardupilot",
    speedup: Annotated[
        float, typer.Option("--speedup", min=0.01, max=1000.0, help="Times as fast as the clock on the wall.")
    ] = 1.0,
    port_base: Annotated[
        Optional[int],  # noqa: UP045
        typer.Option(min=1, max=65535, help="In place of 5760 (ardupilot) or 14540 (px4)."),
    ] = None,
    to: Annotated[
        Optional[list[str]],  # noqa: UP045
        typer.Option(help="One more endpoint for all vehicles: udpout:127.0.0.1:14550, mcast:, …"),
    ] = None,
    host: Annotated[str, typer.Option(help="Interface to listen on.")] = "127.0.0.1",
    first_id: Annotated[int, typer.Option(min=1, max=254, help="System id of the first vehicle.")] = 1,
    vehicle: Annotated[str, typer.Option(help="A file, or firefly, hummingbird.")] = "firefly",
    sensors: Annotated[str, typer.Option(help="truth, rtk or gnss.")] = "truth",
    physics: Annotated[str, typer.Option(help="own or jsbsim.")] = "own",
    startup: Annotated[
        str, typer.Option(help="quick, or realistic: GPS and estimator take their time.")
    ] = "quick",
    response: Annotated[
        str, typer.Option(help="exact, or firmware: it lags behind set-points as the real one.")
    ] = "exact",
    origin: Annotated[Optional[str], typer.Option(help="LATITUDE,LONGITUDE[,ALTITUDE].")] = None,  # noqa: UP045
    wind: Annotated[Optional[str], typer.Option(help="m/s towards east, or EAST,NORTH[,UP].")] = None,  # noqa: UP045
    spacing: Annotated[float, typer.Option(min=0.0, max=1000.0, help="m between vehicles.")] = 3.0,
    seed: Annotated[int, typer.Option(min=0, help="Of sensors' noise.")] = 1,
    state: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(help="Directory where parameters and missions are kept."),
    ] = None,
    signing_key: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(help="Only what is signed with it counts; see outrider key."),
    ] = None,
    seconds: Annotated[Optional[float], typer.Option(min=0.0, help="End by itself after that.")] = None,  # noqa: UP045
    as_json: Annotated[
        bool,
        typer.Option("--json", help="One JSON object on standard output when all are up, one at the end."),
    ] = False,
) -> None:
    """Emulate vehicles that MAVSDK, MAVProxy, pymavlink and ground stations can connect to, until Ctrl-C."""
    from outrider.hangar.command import Terms, run
    from outrider.hangar.request import Options, checked

    options = Options(
        count=count,
        first_id=first_id,
        flavour=flavour,
        vehicle=vehicle,
        sensors=sensors,
        physics=physics,
        startup=startup,
        response=response,
        origin=origin,
        wind=wind,
        spacing=spacing,
        speedup=speedup,
        seed=seed,
        signing_key=signing_key,
    )
    raise typer.Exit(run(checked(options), Terms(port_base, tuple(to or ()), host, state, seconds, as_json)))


@app.command()
def doctor(
    endpoint: Annotated[
        str, typer.Argument(help="udpin:HOST:PORT, tcp:HOST:PORT, /dev/DEVICE,BAUD, …, or tlog:PATH.")
    ],
    system: Annotated[
        Optional[int],  # noqa: UP045
        typer.Option(min=1, max=255, help="System id of the vehicle; if not said, the lowest."),
    ] = None,
    seconds: Annotated[float, typer.Option(min=1.0, max=600.0, help="Wait so long at most.")] = 15.0,
    key: Annotated[Optional[Path], typer.Option(help="Key file of a link that is signed.")] = None,  # noqa: UP045
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on standard output.")] = False,
) -> None:
    """Say what is at an endpoint or in a log, what an escort misses there, and what to do about it. It asks,
    and changes nothing. Ends with 1 if something is in the way of an escort."""
    from outrider.doctor.command import doctor as examining

    raise typer.Exit(examining(endpoint, system, seconds, key, as_json))


@app.command()
def fly(
    autopilot: Annotated[
        str,
        typer.Option(help="udpin:HOST:PORT, tcp:HOST:PORT, /dev/…,BAUD, …; tlog:PATH to rehearse."),
    ],
    config: Annotated[str, typer.Option(help="A file, or ardupilot, px4.")],
    swarm: Annotated[Optional[str], typer.Option(help="Endpoint of the other companions.")] = None,  # noqa: UP045
    target: Annotated[Optional[str], typer.Option(help="Endpoint of the target; the swarm's.")] = None,  # noqa: UP045
    ground: Annotated[Optional[str], typer.Option(help="Endpoint of orders; the autopilot's.")] = None,  # noqa: UP045
    system: Annotated[
        Optional[int],  # noqa: UP045
        typer.Option(min=1, max=250, help="In place of the file's system id; each vehicle has another."),
    ] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Plan and say what would be sent; steer and arm nothing.")
    ] = False,
    realtime: Annotated[bool, typer.Option("--realtime", help="Ask for real-time priority.")] = False,
    signing_key: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(help="Only what is signed with it counts; see outrider key."),
    ] = None,
    out: Annotated[Optional[Path], typer.Option(help="Run directory; new or empty.")] = None,  # noqa: UP045
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on standard output.")] = False,
    seconds: Annotated[Optional[float], typer.Option(min=0.0, help="Hold and end after that.")] = None,  # noqa: UP045
    go: Annotated[
        bool, typer.Option("--go", help="The operator's go, given as soon as all is ready: it takes off.")
    ] = False,
) -> None:
    """Fly one vehicle as part of a swarm: a companion on a real or emulated autopilot, until it has landed
    or Ctrl-C, which leaves it holding its place. Orders are typed: go, hold, return, land (docs/fly.md)."""
    from outrider.aboard.command import run
    from outrider.aboard.request import Options, checked

    options = Options(
        autopilot,
        config,
        swarm,
        target,
        ground,
        system,
        dry_run,
        realtime,
        signing_key,
        out,
        seconds,
        go,
        as_json,
    )
    raise typer.Exit(run(checked(options)))


@app.command()
def sweep(
    name: Annotated[str, typer.Argument(help="A file, or the name of a shipped sweep.")],
    runs: Annotated[Optional[int], typer.Option(min=1, max=1_000_000, help="Seeds per cell.")] = None,  # noqa: UP045
    jobs: Annotated[Optional[int], typer.Option(min=1, help="Processes; as many as cores.")] = None,  # noqa: UP045
    out: Annotated[Optional[Path], typer.Option(help="Directory; one begun is gone on with.")] = None,  # noqa: UP045
    wall_limit: Annotated[float, typer.Option(min=1.0, help="s of wall time for one run.")] = 1800.0,
    scheduler: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option(metavar="ADDRESS", help="Fly on the workers of a Dask scheduler: tcp://HOST:PORT."),
    ] = None,
    regressions: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(metavar="FOLDER", help="Write every run that failed there, as a scenario."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on standard output.")] = False,
) -> None:
    """Fly many seeds of a grid of scenarios or random scenes. What was killed can be gone on with."""
    from outrider.sweeps.command import sweep as sweeping

    raise typer.Exit(
        sweeping(name, runs, jobs, out, as_json, wall_limit, scheduler=scheduler, failures=regressions)
    )


@app.command()
def paper(
    seeds: Annotated[int, typer.Option(min=1, max=1000, help="Flights of each row.")] = 10,
    jobs: Annotated[Optional[int], typer.Option(min=1, help="Processes; as many as cores.")] = None,  # noqa: UP045
    out: Annotated[Optional[Path], typer.Option(help="Directory; one begun is gone on with.")] = None,  # noqa: UP045
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on standard output.")] = False,
) -> None:
    """Fly the paper's methods and scenarios, and put its table beside ours."""
    from outrider.paper.command import paper as comparing

    raise typer.Exit(comparing(seeds, jobs, out, as_json))


@app.command()
def gallery(
    names: Annotated[
        Optional[list[str]],  # noqa: UP045
        typer.Argument(metavar="[SCENARIO]...", help="Names of shipped scenarios; all without."),
    ] = None,
    jobs: Annotated[Optional[int], typer.Option(min=1, help="Processes; as many as cores.")] = None,  # noqa: UP045
    out: Annotated[Optional[Path], typer.Option(help="Directory; one begun is gone on with.")] = None,  # noqa: UP045
    page: Annotated[Optional[Path], typer.Option(metavar="FOLDER", help="Page and pictures there.")] = None,  # noqa: UP045
) -> None:
    """Fly every method in every scenario, and draw a page of pictures."""
    from outrider.gallery.command import gallery as drawing

    raise typer.Exit(drawing(tuple(names or ()), jobs, out, page))


@app.command()
def replay(
    log: Annotated[
        Path,
        typer.Argument(metavar="LOG", help="A tlog, or what a flight left: logs and configuration.yaml."),
    ],
    listing: Annotated[
        bool, typer.Option("--list", help="Show who is in the log, and what is damaged.")
    ] = False,
    certify: Annotated[
        bool, typer.Option("--certify", help="Check from the plans on the wire that all kept apart.")
    ] = False,
    own: Annotated[Optional[int], typer.Option(min=1, max=255, help="The own vehicle's system id.")] = None,  # noqa: UP045
    neighbours: Annotated[Optional[str], typer.Option(help="Their system ids, with commas.")] = None,  # noqa: UP045
    target: Annotated[Optional[int], typer.Option(min=1, max=255, help="The target's system id.")] = None,  # noqa: UP045
    like: Annotated[str, typer.Option(help="Scenario whose companions' settings count.")] = "escort",
    speed: Annotated[Optional[float], typer.Option(min=0.01, max=1000.0, help="Times the log's own.")] = None,  # noqa: UP045
    to: Annotated[Optional[str], typer.Option(help="Endpoint for the log's telemetry; no commands.")] = None,  # noqa: UP045
    out: Annotated[Optional[Path], typer.Option(help="Directory; new or empty.")] = None,  # noqa: UP045
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on standard output.")] = False,
) -> None:
    """Replay a log: what would a companion have sent (--own), or a vehicle of ours around what is recorded
    (--target)? Or a flight of ours: does each companion, given what it received, send what it sent? Ends with
    1 if not, or if there are findings."""
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
    from outrider.replaying.request import Request

    request = Request(log, own, neighbours, target, like, speed, to, out, as_json)
    raise typer.Exit(request.run())


@app.command()
def export(
    source: Annotated[Path, typer.Argument(help="What a flight left, or a tlog.", metavar="RUN_DIR|LOG")],
    form: Annotated[str, typer.Option("--format", help="mcap, csv, parquet or ulog.")],
    out: Annotated[Optional[Path], typer.Option(help="File (mcap) or directory; new.")] = None,  # noqa: UP045
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on standard output.")] = False,
) -> None:
    """Turn a run or a log into files for Foxglove, PlotJuggler, tables or PX4's tools."""
    from outrider.exports.command import export as exporting

    exporting(source, form, out, as_json)


@app.command()
def report(
    run_dir: Annotated[Path, typer.Argument(help="What a flight left.")],
    out: Annotated[Optional[Path], typer.Option(help="The page; RUN_DIR/report.html if not said.")] = None,  # noqa: UP045
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on standard output.")] = False,
) -> None:
    """Make one HTML page of a run: summary, replay, charts, events and message loss. It needs no network."""
    from outrider.report.command import report as reporting

    raise typer.Exit(reporting(run_dir, out, as_json))


@app.command()
def key(file: Annotated[Path, typer.Argument(help="New; only you may read it.")]) -> None:
    """Make a key with which vehicles and those who may command them sign what they say (docs/signing.md)."""
    from outrider.key_files import new_key

    sys.stdout.write(f"{new_key(file)}\n")


@app.command()
def bench(
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on standard output.")] = False,
    quick: Annotated[bool, typer.Option("--quick", help="Fewer rounds, no flight.")] = False,
) -> None:
    """Measure this machine: plan step, PIQP, physics, codec, tlog, real-time factor (CPU time)."""
    from outrider.bench import measure
    from outrider.console import share_progress, show_bench

    with share_progress() as watch:
        figures = measure(watch, quick=quick)
    if as_json:
        sys.stdout.write(json.dumps(figures) + "\n")
    else:
        show_bench(figures)


def main() -> None:
    """Run the command line: bad input ends with status 2 and one line for each fault, never with a
    traceback."""
    from mavlink_bridge.errors import BridgeError

    try:
        status = app(standalone_mode=False)
    except InputError as error:
        sys.stderr.write(f"{error}\n")
        sys.exit(BAD_INPUT)
    except _UsageError as error:
        said = error.format_message()
        if said:
            command = "outrider" if error.ctx is None else error.ctx.command_path
            line = f"{command}: {said.rstrip('.')}; see {command} --help"
            sys.stderr.write(f"{InputError(line)}\n")
        sys.exit(BAD_INPUT)
    except (typer.Abort, KeyboardInterrupt):
        sys.stderr.write("outrider: stopped\n")
        sys.exit(FAULT)
    except (OutriderError, BridgeError, OSError) as error:
        sys.stderr.write(f"outrider: {error}\n")
        sys.exit(FAULT)
    except Exception as error:
        # A fault of ours must not look like a collision, which has status 1.
        if os.environ.get("OUTRIDER_TRACEBACK"):
            raise
        sys.stderr.write(f"outrider: {_words(error)}\n")
        sys.exit(FAULT)
    if status == _INTERRUPTED:
        sys.stderr.write("outrider: stopped\n")
        status = FAULT
    sys.exit(status)


def _words(error: Exception) -> str:
    """What went wrong, and what to do."""
    if isinstance(error, ModuleNotFoundError):
        package = (error.name or "").partition(".")[0]
        if package in _EXTRAS:
            return (
                f"this command needs {package}, which is not installed: "
                f"pip install 'outrider[{_EXTRAS[package]}]'"
            )
    return f"{type(error).__name__}: {error}; OUTRIDER_TRACEBACK=1 shows where"


if __name__ == "__main__":
    main()
