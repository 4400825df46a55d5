"""Command ``outrider preflight``: checks its options, runs the node over its links, writes the fleet file."""

from __future__ import annotations

import json
import os
import secrets
import sys
from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from companion.config import CompanionConfig
from companion.flight.hold_on_exit import HoldOnExit
from mavlink_bridge.clocks.clock import Clock, WallClock
from mavlink_bridge.clocks.system_clock import KernelClock
from mavlink_bridge.errors import EndpointError, LinkError
from mavlink_bridge.links.endpoints import Endpoint, Replay, parse_endpoint
from mavlink_bridge.links.link import Link
from mavlink_bridge.links.opening import open_link
from mavlink_bridge.loops.lockstep import Direction
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.signing import Signing
from outrider.errors import InputError
from outrider.interruption import insisted, noted, suspending_signals_ignored
from outrider.key_files import key_of
from outrider.onboard.hold_on_exit import farewell
from outrider.onboard.instance_lock import instance_lock
from outrider.onboard.line_input import typing
from outrider.onboard.log import Log
from outrider.onboard.read_only_link import ReadOnlyLink
from outrider.preflight.course import Box, box_of
from outrider.preflight.findings import Verdict
from outrider.preflight.node import Preflight
from outrider.preflight.page import document, show
from outrider.preflight.terms import FlightTerms, Terms
from outrider.preflight.tube import tracking_error
from outrider.preflight.typed_orders import STOPS, TypedOrders
from outrider.resources import find
from outrider.runs import names
from outrider.scenarios.fleet_file import text_of, with_fleet_file
from outrider.scenarios.fly_config import FlyConfig
from outrider.terminal.lines import say
from outrider.terminal.share_progress import share_progress
from outrider.yaml_files.yaml_file import load

READY, NOT_READY = 0, 1
_LOCAL: Final = ("autopilot", "swarm")


@dataclass(frozen=True)
class Options:
    """Options of the command line, unchecked. ``roster``: system ids, joined by commas."""

    autopilot: str
    swarm: str
    config: str
    system: int | None = None
    roster: str | None = None
    seconds: float = 20.0
    wait: float = 120.0
    signing_key: Path | None = None
    flight: Path | None = None
    out: Path = Path("fleet.yaml")
    as_json: bool = False
    fly: bool = False
    go: bool = False
    box: str | None = None
    dry_run: bool = False


@dataclass(frozen=True)
class Request:
    """Checked request; ``period`` (µs): between two steps."""

    terms: Terms
    endpoints: dict[str, Endpoint]
    period: int


def checked(options: Options) -> Request:
    """Return the checked request. Raises InputError, which names the faulty option and allowed values."""
    place = find("companions", options.config)
    config = load(place, FlyConfig)
    if options.system is not None:
        config = config.model_copy(update={"system": options.system})
    if not config.system:
        raise InputError(
            f"--system: is missing, here and in {options.config}; needed: the id of the own autopilot, 1…250"
        )
    config = with_fleet_file(config, place)
    companion = config.settings
    roster = companion.certified.fleet
    if options.roster is not None:
        named = _roster(options.roster)
        if roster and set(roster) != set(named):
            ids = ", ".join(map(str, sorted(set(roster))))
            raise InputError(
                f"--roster {options.roster}: the file names {ids}; allowed: these, or no --roster"
            )
        roster = named
    if not roster:
        raise InputError(
            "--roster: is missing, and certified.fleet is empty; needed: the system ids of all vehicles, such"
            " as 1,2,3"
        )
    if config.system not in roster or len(set(roster)) < 2:
        ids = ", ".join(map(str, sorted(set(roster))))
        raise InputError(
            f"roster {ids}: needed: two vehicles at least, and the own id {config.system} among them"
        )
    companion = _with_roster(companion, tuple(sorted(set(roster))))
    endpoints = {name: _endpoint(name, getattr(options, name)) for name in _LOCAL}
    run = secrets.randbits(32)
    flown = None
    if options.flight is not None:
        flown = tracking_error(
            options.flight, config.system, planar=companion.planar, lead=companion.setpoint_lead_us
        )
    fly = _flight(options, config, companion)
    terms = Terms(config.system, companion, config.origin, options.seconds, options.wait, run, flown, fly)
    return Request(terms, endpoints, config.period_us)


def _flight(options: Options, config: FlyConfig, companion: CompanionConfig) -> FlightTerms | None:
    """Return the terms of the flight alone; None without ``--fly``. Raises InputError."""
    if not options.fly:
        for name in ("go", "box"):
            if getattr(options, name):
                raise InputError(f"--{name}: is of a flight; allowed with it: --fly")
        return None
    if options.flight is not None:
        raise InputError("--flight: does not go with --fly, which measures the tube by a flight of its own")
    if options.go and options.dry_run:
        raise InputError("--go: does not go with --dry-run, in which nothing takes off")
    if config.radio is not None:
        raise InputError(f"--fly: committed plans do not fit radio {config.radio}; needed: radio: null")
    if config.clock == "autopilot":
        raise InputError(
            "--fly: clock 'autopilot' follows the autopilot's, and committed plans need a clock that runs"
            " evenly; allowed: wall, auto"
        )
    box = box_of(options.box or ",".join(f"{edge:g}" for edge in Box()), planar=companion.planar)
    height = config.takeoff_height
    return FlightTerms(config.target, height, box, go=options.go, dry=options.dry_run)


def _with_roster(companion: CompanionConfig, roster: tuple[int, ...]) -> CompanionConfig:
    certified = companion.certified.model_copy(update={"fleet": roster})
    return companion.model_copy(update={"certified": certified})


def _roster(text: str) -> tuple[int, ...]:
    parts = [part.strip() for part in text.split(",")]
    ids = [int(part) for part in parts if part.isascii() and part.isdigit() and len(part) <= 3]
    if len(ids) < len(parts) or not all(1 <= one <= 250 for one in ids) or len(set(ids)) < len(ids):
        raise InputError(f"--roster {text}: allowed: different system ids, 1…250, joined by commas")
    return tuple(ids)


def _endpoint(name: str, text: str) -> Endpoint:
    try:
        endpoint = parse_endpoint(text)
    except EndpointError as error:
        raise InputError(f"--{name} {error}") from None
    if isinstance(endpoint, Replay):
        raise InputError(f"--{name} {text}: a log answers nothing; allowed: a live endpoint")
    return endpoint


def preflight(options: Options) -> int:
    """Check the fleet, print the verdict, write the fleet file, and return the exit status.

    Raises InputError for a wrong option or file, for a link that cannot be opened, for a fleet file that
    cannot be written, and if a companion of the vehicle runs.
    """
    request = checked(options)
    folder = options.out.parent
    if options.out.is_dir() or not folder.is_dir():
        raise InputError(f"--out {options.out}: needed: a file in a folder that exists")
    key = None if options.signing_key is None else key_of(options.signing_key)
    signing, in_flight = (None, None) if key is None else (Signing(key), Signing(key))
    clock = WallClock()
    node = Preflight(request.terms, signing, KernelClock(clock.offset_ns), in_flight)
    with instance_lock(request.terms.system, request.endpoints["autopilot"]), ExitStack() as opened:
        links: dict[Endpoint, Link] = {}
        try:
            for endpoint in dict.fromkeys(request.endpoints.values()):
                links[endpoint] = opened.enter_context(closing(open_link(endpoint, clock)))
        except LinkError as error:
            raise InputError(f"preflight {error}") from None
        ends = {name: links[endpoint] for name, endpoint in request.endpoints.items()}
        if options.dry_run and ends["autopilot"] is not ends["swarm"]:
            ends["autopilot"] = ReadOnlyLink(ends["autopilot"])
        flies = request.terms.fly is not None and not request.terms.fly.dry
        if flies:
            verdict = flown(node, ends, clock, request.period, folder, in_flight)
        else:
            verdict = run(node, ends, clock, request.period)
    written = None if options.dry_run else _written(options.out, verdict)
    if options.as_json:
        sys.stdout.write(json.dumps(document(verdict, written)) + "\n")
    else:
        show(verdict, written, dry=options.dry_run)
    return READY if verdict.passed else NOT_READY


def flown(
    node: Preflight,
    links: dict[str, Link],
    clock: Clock,
    period: int,
    folder: Path,
    signing: Signing | None,
) -> Verdict:
    """Run ``node``, which may fly, with the operator's orders and the signals; return the verdict.

    What passes on the links is logged in ``folder``. If the process ends while it controls the vehicle, by a
    signal, the order ``quit`` or an exception, the autopilot is requested to hold. ``signing``: that of the
    flight.
    """
    system = node.system
    with (
        noted(STOPS) as stops,
        suspending_signals_ignored(),
        typing(False) as typed,
        Log(folder / f"preflight-{system}", system, lambda why: say(f"preflight: {why}")) as log,
    ):
        orders = TypedOrders(node, typed, stops, say)
        try:
            return run(node, links, clock, period, orders.look, log)
        finally:
            flight = node.flight
            if flight is not None and flight.controls:
                word = HoldOnExit(system, flight.heartbeat, signing)
                farewell(word, links["autopilot"], clock, lambda: insisted(stops))
                say(f"the vehicle: {word.said or 'asked to hold, no answer yet'}")
                if word.failed:
                    say("the vehicle is armed and nothing controls it: take it over")


def run(
    node: Preflight,
    links: dict[str, Link],
    clock: Clock,
    period: int,
    look: Callable[[int], None] = lambda _: None,
    tap: Callable[[int, str, Direction, Sequence[Datagram]], None] | None = None,
) -> Verdict:
    """Step ``node`` every ``period`` (µs) over its ``links`` until it is over; return the verdict.

    Several of the names may have the same link. ``look`` is called before each step, with its time (µs);
    ``tap`` observes what is received and sent.
    """
    with share_progress() as watch:
        now = clock.now()
        while not node.over:
            at = clock.now()
            look(at)
            inbox = [
                Datagram(name, data)
                for link in {id(link): link for link in links.values()}.values()
                for data in link.receive()
                for name, own in links.items()
                if own is link
            ]
            leaving = node.step(at, inbox)
            for datagram in leaving:
                links[datagram.link].send(datagram.data)
            if tap is not None:
                tap(at, names.companion(node.system), "in", inbox)
                tap(at, names.companion(node.system), "out", leaving)
            watch(node.doing, node.share)
            now = max(now + period, clock.now())
            clock.wait_until(now)
    return node.verdict()


def _written(path: Path, verdict: Verdict) -> Path | None:
    """Write the fleet file at once, so that no process reads half of one; return its path."""
    if verdict.fleet is None:
        return None
    part = path.with_name(f"{path.name}.{os.getpid()}")
    try:
        part.write_text(text_of(verdict.fleet), encoding="utf-8")
        part.replace(path)
    except OSError as error:
        raise InputError(f"--out {path}: cannot be written: {error.strerror}") from None
    return path
