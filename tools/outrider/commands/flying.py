"""Commands that fly (swarm, sitl, fly) or check an endpoint before a flight (doctor)."""

from __future__ import annotations

import gc
import json
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer

from outrider.commands.options import (
    METHODS,
    PHYSICS,
    RESPONSE,
    SENSORS,
    AsJson,
    RunDirectory,
    SigningKey,
    Wind,
    shipped,
)


def swarm(
    scenario: Annotated[
        str,
        typer.Argument(
            help="A file, or the name of a shipped scenario.", autocompletion=shipped("scenarios")
        ),
    ],
    method: Annotated[str | None, typer.Option(help=METHODS)] = None,
    avoidance: Annotated[str | None, typer.Option(help="field or certified.")] = None,
    planar: Annotated[bool, typer.Option("--planar", help="Fix the height, as the paper.")] = False,
    vehicles: Annotated[int | None, typer.Option(help="How many fly.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of jitter, phases and link faults.")] = 1,
    loss: Annotated[float | None, typer.Option(min=0.0, max=1.0, help="Share of messages lost.")] = None,
    delay_ms: Annotated[
        float | None, typer.Option(min=0.0, help="Delay of the swarm and target links, ms.")
    ] = None,
    sensors: Annotated[str | None, typer.Option(help=SENSORS)] = None,
    wind: Wind = None,
    replan_hz: Annotated[float | None, typer.Option(help="Plans per second.")] = None,
    physics: Annotated[str | None, typer.Option(help=PHYSICS)] = None,
    flavour: Annotated[
        str | None,
        typer.Option(help="ardupilot, px4, or several joined by commas: one vehicle after another."),
    ] = None,
    response: Annotated[str | None, typer.Option(help=RESPONSE)] = None,
    real_time: Annotated[
        bool, typer.Option("--real-time", help="Under the wall clock: a process per node, over UDP.")
    ] = False,
    realtime: Annotated[
        bool, typer.Option("--realtime", help="Ask for real-time priority; implies --real-time.")
    ] = False,
    processes: Annotated[
        int,
        typer.Option(min=1, help="Processes that share the vehicles in lock-step; the bytes are the same."),
    ] = 1,
    view: Annotated[bool, typer.Option("--view", help="Watch it in the browser (docs/view.md).")] = False,
    out: RunDirectory = None,
    as_json: AsJson = False,
) -> None:
    """Fly a scenario, in lock-step by default, and write logs, summary and picture to a run directory."""
    from outrider.terminal.compilation import say_if_compiling

    say_if_compiling()
    from outrider.errors import Fault, InputError
    from outrider.report.command import NAME, make, write
    from outrider.runs.summary import exit_status
    from outrider.scenarios.options import Options, named
    from outrider.scenarios.replanning import doubts_of_plans
    from outrider.simulation.console import progress, show
    from outrider.simulation.preparation import prepare
    from outrider.swarm import command as flying
    from outrider.terminal.share_progress import share_progress

    options = Options(
        method,
        avoidance,
        planar,
        vehicles,
        loss,
        delay_ms,
        sensors,
        replan_hz,
        wind,
        physics,
        flavour,
        response,
    )
    if processes > 1 and (real_time or realtime):
        wrong = f"is {processes} with --real-time, which has a process per node; allowed: one of the two"
        raise InputError(Fault("--processes", wrong))
    prepared = prepare(scenario, options)
    doubt = doubts_of_plans(prepared.scenario.companion)
    if doubt and replan_hz is None:
        sys.stderr.write(f"outrider swarm: {doubt}\n")
    with ExitStack() as open_:
        shown = None
        if view:
            from outrider.swarm.show import showing

            shown = open_.enter_context(showing())
        directory = flying.run_directory(out, prepared.scenario, seed, named(options))
        with progress(prepared.scenario.duration_s) as watch:
            pace = flying.Pace(real_time or realtime, realtime, processes)
            summary = flying.fly(prepared, seed, directory, watch, pace, shown)
        # A flight of many vehicles leaves a gigabyte of garbage; free it before the logs are read.
        gc.collect()
        with share_progress() as reading:
            made = make(directory, reading)
        write(directory / NAME, made.text)
        if as_json:
            sys.stdout.write(json.dumps(summary) + "\n")
            sys.stdout.flush()
        else:
            show(summary)
        if shown is not None:
            shown.stay(directory)
    raise typer.Exit(exit_status(summary))


def sitl(
    count: Annotated[int, typer.Option(min=1, max=254, help="Vehicles.")] = 1,
    flavour: Annotated[str, typer.Option(help="ardupilot or px4.")] = "ardupilot",
    speedup: Annotated[
        float, typer.Option("--speedup", min=0.01, max=1000.0, help="Times as fast as the clock on the wall.")
    ] = 1.0,
    port_base: Annotated[
        int | None,
        typer.Option(min=1, max=65535, help="In place of 5760 (ardupilot) or 14540 (px4)."),
    ] = None,
    to: Annotated[
        list[str] | None,
        typer.Option(help="One more endpoint for all vehicles: udpout:127.0.0.1:14550, mcast:, …"),
    ] = None,
    host: Annotated[str, typer.Option(help="Interface to listen on.")] = "127.0.0.1",
    first_id: Annotated[int, typer.Option(min=1, max=254, help="System id of the first vehicle.")] = 1,
    vehicle: Annotated[str, typer.Option(help="A file, or firefly, hummingbird.")] = "firefly",
    sensors: Annotated[str, typer.Option(help=SENSORS)] = "truth",
    physics: Annotated[str, typer.Option(help=PHYSICS)] = "own",
    startup: Annotated[
        str,
        typer.Option(help="quick, or realistic: GPS and estimator take their time."),
    ] = "quick",
    response: Annotated[str, typer.Option(help=RESPONSE)] = "firmware",
    origin: Annotated[str | None, typer.Option(help="LATITUDE,LONGITUDE[,ALTITUDE].")] = None,
    wind: Wind = None,
    spacing: Annotated[float, typer.Option(min=0.0, max=1000.0, help="m between vehicles.")] = 3.0,
    columns: Annotated[
        int | None, typer.Option(min=1, max=254, help="Vehicles side by side; by default a square.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the sensor noise.")] = 1,
    state: Annotated[
        Path | None,
        typer.Option(help="Directory where parameters and missions are kept."),
    ] = None,
    signing_key: SigningKey = None,
    camera: Annotated[
        str | None,
        typer.Option(
            help="Cameras of the vehicles and what they see: a file, or walker.",
            autocompletion=shipped("cameras"),
        ),
    ] = None,
    seconds: Annotated[float | None, typer.Option(min=0.0, help="End after so many s.")] = None,
    as_json: Annotated[
        bool,
        typer.Option("--json", help="One JSON object on standard output when all are up, one at the end."),
    ] = False,
) -> None:
    """Emulate vehicles that MAVSDK, MAVProxy, pymavlink and ground stations can connect to, until Ctrl-C."""
    from outrider.sitl_server.command import Terms, run
    from outrider.sitl_server.request import Options, checked

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
        columns=columns,
        speedup=speedup,
        seed=seed,
        signing_key=signing_key,
        camera=camera,
    )
    raise typer.Exit(run(checked(options), Terms(port_base, tuple(to or ()), host, state, seconds, as_json)))


def doctor(
    endpoint: Annotated[
        str, typer.Argument(help="udpin:HOST:PORT, tcp:HOST:PORT, /dev/DEVICE,BAUD, …, or tlog:PATH.")
    ],
    system: Annotated[
        int | None,
        typer.Option(min=1, max=255, help="System id of the vehicle; by default the lowest."),
    ] = None,
    seconds: Annotated[
        float,
        typer.Option(
            min=1.0, max=600.0, help="Maximum wait, s; longer only for the reasons of a failed pre-arm check."
        ),
    ] = 15.0,
    key: Annotated[Path | None, typer.Option(help="Key file of a link that is signed.")] = None,
    as_json: AsJson = False,
) -> None:
    """List what is at an endpoint or in a log, what an escort lacks there, and the remedies.

    It only sends requests and changes nothing. Exits with 1 if something prevents an escort.
    """
    from outrider.doctor.command import doctor as examining

    raise typer.Exit(examining(endpoint, system, seconds, key, as_json))


def preflight(
    autopilot: Annotated[str, typer.Option(help="udpin:HOST:PORT, tcp:HOST:PORT, /dev/…,BAUD, ….")],
    swarm: Annotated[str, typer.Option(help="Endpoint of the other companions.")],
    config: Annotated[str, typer.Option(help="A file, or ardupilot, px4: that of the flight.")],
    system: Annotated[
        int | None,
        typer.Option(min=1, max=250, help="In place of the file's system id; unique to each vehicle."),
    ] = None,
    roster: Annotated[
        str | None, typer.Option(help="System ids of all vehicles, such as 1,2,3; by default the file's.")
    ] = None,
    seconds: Annotated[
        float, typer.Option(min=5.0, max=3600.0, help="Duration of the measurement, s.")
    ] = 20.0,
    wait: Annotated[
        float, typer.Option(min=1.0, max=86400.0, help="Longest time to wait for the others, s.")
    ] = 120.0,
    signing_key: SigningKey = None,
    flight: Annotated[
        Path | None, typer.Option(help="Log of a flight of this vehicle alone, which measures the tube.")
    ] = None,
    out: Annotated[Path, typer.Option(help="The fleet file; one that exists is replaced.")] = Path(
        "fleet.yaml"
    ),
    as_json: AsJson = False,
    fly: Annotated[
        bool, typer.Option("--fly", help="Fly a small course alone, after a go, which measures the tube.")
    ] = False,
    go: Annotated[
        bool, typer.Option("--go", help="The operator's go, given as soon as it is its turn: it takes off.")
    ] = False,
    box: Annotated[
        str | None, typer.Option(help="Course of --fly: EAST,NORTH,UP in m from above the start (8,8,3).")
    ] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Check, and show what would be written; fly and write nothing.")
    ] = False,
) -> None:
    """Check a fleet before a certified flight, by one process on each companion, and write the fleet file.

    It measures links, clocks and the accuracy of positions, and reads parameters; without --fly it arms and
    moves nothing. Exits with 1 if a check fails (docs/preflight.md).
    """
    from outrider.terminal.compilation import say_if_compiling

    if fly:
        say_if_compiling()
    from outrider.preflight.command import Options
    from outrider.preflight.command import preflight as checking

    options = Options(
        autopilot,
        swarm,
        config,
        system,
        roster,
        seconds,
        wait,
        signing_key,
        flight,
        out,
        as_json,
        fly,
        go,
        box,
        dry_run,
    )
    raise typer.Exit(checking(options))


def fly(
    autopilot: Annotated[
        str,
        typer.Option(help="udpin:HOST:PORT, tcp:HOST:PORT, /dev/…,BAUD, …; tlog:PATH to rehearse."),
    ],
    config: Annotated[
        str, typer.Option(help="A file, or ardupilot, px4.", autocompletion=shipped("companions"))
    ],
    swarm: Annotated[str | None, typer.Option(help="Endpoint of the other companions.")] = None,
    target: Annotated[
        str | None, typer.Option(help="Endpoint of the target; by default the swarm's.")
    ] = None,
    ground: Annotated[
        str | None, typer.Option(help="Endpoint of orders; by default the autopilot's.")
    ] = None,
    system: Annotated[
        int | None,
        typer.Option(min=1, max=250, help="In place of the file's system id; unique to each vehicle."),
    ] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Plan and say what would be sent; steer and arm nothing.")
    ] = False,
    realtime: Annotated[bool, typer.Option("--realtime", help="Ask for real-time priority.")] = False,
    signing_key: SigningKey = None,
    out: RunDirectory = None,
    as_json: AsJson = False,
    seconds: Annotated[float | None, typer.Option(min=0.0, help="Hold and end after so many s.")] = None,
    go: Annotated[
        bool, typer.Option("--go", help="The operator's go, given as soon as all is ready: it takes off.")
    ] = False,
) -> None:
    """Fly one vehicle of a swarm: a companion on a real or emulated autopilot.

    It runs until the vehicle has landed, or until Ctrl-C, which leaves the vehicle holding its position.
    Orders are typed: go, hold, return, land (docs/fly.md).
    """
    from outrider.terminal.compilation import say_if_compiling

    say_if_compiling()
    from outrider.onboard.command import run
    from outrider.onboard.request import Options, checked

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
