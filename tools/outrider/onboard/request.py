"""Checked request of ``outrider fly``: endpoints, configuration file and options."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

from companion.config.target_source import GlobalPositionSource
from mavlink_bridge.errors import EndpointError
from mavlink_bridge.key import Key
from mavlink_bridge.links.endpoints import Endpoint, Multicast, Replay, parse_endpoint
from outrider.address_scope import exposed
from outrider.errors import InputError
from outrider.key_files import key_of
from outrider.onboard.link_budget import doubts, doubts_of_autopilot
from outrider.onboard.unmeasured_tube import doubts_of_tube
from outrider.resources import find
from outrider.scenarios.fleet_file import with_fleet_file
from outrider.scenarios.fly_config import FlyConfig
from outrider.scenarios.replanning import doubts_of_plans
from outrider.yaml_files.yaml_file import load


@dataclass(frozen=True)
class Options:
    """Options of the command line, unchecked."""

    autopilot: str
    config: str
    swarm: str | None = None
    target: str | None = None
    ground: str | None = None
    system: int | None = None
    dry_run: bool = False
    realtime: bool = False
    signing_key: Path | None = None
    out: Path | None = None
    seconds: float | None = None
    go: bool = False
    as_json: bool = False


@dataclass(frozen=True)
class Request:
    """Checked request.

    ``endpoints`` maps the companion's link names to endpoints, of which several may be equal; it is empty if
    ``log`` is given, the recorded flight of a dry run.
    """

    config: FlyConfig
    name: str
    endpoints: dict[str, Endpoint]
    log: Path | None = None
    dry_run: bool = False
    realtime: bool = False
    key: Key | None = None
    out: Path | None = None
    seconds: float | None = None
    go: bool = False
    as_json: bool = False

    @property
    def system(self) -> int:
        """System id of the vehicle and its companion."""
        return self.config.system


def checked(options: Options) -> Request:
    """Return the checked request. Raises InputError, which names the faulty option and allowed values."""
    place = find("companions", options.config)
    config = load(place, FlyConfig)
    if options.system is not None:
        if options.system == config.target:
            raise InputError(f"--system {options.system}: is the target's; allowed: another's")
        config = config.model_copy(update={"system": options.system})
    config = with_fleet_file(config, place)
    if options.dry_run and config.certified:
        raise InputError(
            f"--config {options.config}: companion.avoidance 'certified' plans only in agreement with other "
            "companions, to which a dry run sends nothing; allowed with --dry-run: 'field'"
        )
    if options.dry_run and options.go:
        raise InputError("--go: does not go with --dry-run, in which nothing takes off")
    autopilot = _endpoint("autopilot", options.autopilot)
    if isinstance(autopilot, Replay):
        # Nothing flies, so 1 is assumed without a system id. If the log lacks vehicle 1, the shadow run lists
        # the vehicles of the log.
        config = config if config.system else config.model_copy(update={"system": 1})
        return _of_log(options, config, Path(autopilot.path))
    if not config.system:
        raise InputError(
            f"--system: is missing, here and in {options.config}; needed: the id of the own "
            "autopilot (SYSID_THISMAV, MAV_SYS_ID), 1…250, which no other vehicle may have"
        )
    if options.swarm is None:
        raise InputError(
            "--swarm: is missing; needed: the endpoint by which the other companions are heard, such as "
            "mcast:,127.0.0.1 or /dev/ttyUSB0,57600"
        )
    swarm = _endpoint("swarm", options.swarm)
    if config.certified:
        _check_certified(config, swarm)
    endpoints = {
        "autopilot": autopilot,
        "swarm": swarm,
        "target": swarm if options.target is None else _endpoint("target", options.target),
        "ground": autopilot if options.ground is None else _endpoint("ground", options.ground),
    }
    for name in ("swarm", "ground"):
        if isinstance(endpoints[name], Replay):
            raise InputError(f"--{name} {endpoints[name]}: a log hears nothing; allowed: a live endpoint")
    source = config.companion.target_source
    if isinstance(source, GlobalPositionSource) and source.anyone and endpoints["target"] == swarm:
        raise InputError(
            "--target: is the swarm's, where with target_source.anyone every neighbour would be the target; "
            "needed: another endpoint, or anyone: false"
        )
    key = None if options.signing_key is None else key_of(options.signing_key)
    if key is None:
        _warn(endpoints)
    signed = key is not None
    for doubt in (
        doubts(swarm, config.settings, signed),
        doubts_of_autopilot(endpoints["autopilot"], config.settings, signed, dry_run=options.dry_run),
        doubts_of_plans(config.settings),
        doubts_of_tube(config.settings),
    ):
        if doubt:
            sys.stderr.write(f"outrider fly: {doubt}\n")
    return Request(
        config,
        options.config,
        endpoints,
        None,
        options.dry_run,
        options.realtime,
        key,
        options.out,
        options.seconds,
        options.go,
        options.as_json,
    )


def _check_certified(config: FlyConfig, swarm: Endpoint) -> None:
    """Check a request for committed plans with the swarm link ``swarm``. Raises InputError."""
    certified = config.companion.certified
    if config.system not in certified.fleet:
        raise InputError(
            f"--system {config.system}: is not in companion.certified.fleet; "
            f"allowed: {', '.join(map(str, certified.fleet))}"
        )
    if certified.fleet_time == "own" and not (isinstance(swarm, Multicast) and not exposed(swarm)):
        raise InputError(
            f"--swarm {swarm}: companions of other computers, whose clocks differ, may be heard there; "
            "allowed with companion.certified.fleet_time own: mcast:,127.0.0.1, if all run on this "
            "computer; otherwise write fleet_time: measured"
        )
    if config.clock_error is not None:
        sys.stderr.write("outrider fly: clock_error: the companion's clock is made wrong, for a test\n")


def _of_log(options: Options, config: FlyConfig, log: Path) -> Request:
    if not options.dry_run:
        raise InputError(f"--autopilot {options.autopilot}: a log flies nothing; allowed with it: --dry-run")
    for name in ("swarm", "target", "ground", "seconds", "signing_key"):
        if getattr(options, name) is not None:
            raise InputError(
                f"--{name.replace('_', '-')}: does not go with a log, which already contains all links"
            )
    return Request(config, options.config, {}, log, dry_run=True, out=options.out, as_json=options.as_json)


def _endpoint(name: str, text: str) -> Endpoint:
    try:
        return parse_endpoint(text)
    except EndpointError as error:
        raise InputError(f"--{name} {error}") from None


def _warn(endpoints: dict[str, Endpoint]) -> None:
    open_to_all = {str(one): None for one in endpoints.values() if exposed(one)}
    if open_to_all:
        sys.stderr.write(
            f"outrider fly: {', '.join(open_to_all)}: reachable from other machines; without --signing-key, "
            "data and orders of every sender there are accepted\n"
        )
