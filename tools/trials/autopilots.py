"""Simulations of real firmware, to be started or already running, as ``--autopilots`` names them."""

from __future__ import annotations

import re
import shlex
from argparse import ArgumentParser
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from mavlink_bridge.errors import EndpointError
from mavlink_bridge.links.endpoints import TcpOut, UdpIn, UdpOut, parse_endpoint
from outrider.errors import InputError

FEWEST, MOST = 2, 9
"""Smallest and largest number of vehicles of a trial."""
USUAL: Final = 5
"""Number of instances of a program that are started by default."""
PROGRAMS: Final = {"arducopter": "ardupilot", "px4": "px4"}
"""Names of programs, and the flavour of each."""
_PROGRAM = re.compile(r"(?:([^*:/]*)\*)?(arducopter|px4):(.*)", re.DOTALL)
_NEXT = re.compile(r",(?=(?:ardupilot=|px4=)?(?:[a-z]+:|/))")
_FLAVOUR = re.compile(r"(ardupilot|px4)=(.*)", re.DOTALL)
_SERIAL1: Final = 2
"""Offset from the TCP port of ArduPilot's SERIAL0 to that of its SERIAL1."""
_GROUND: Final = 14550
"""UDP port to which every PX4 sends as to a ground station."""
_FORMS: Final = (
    "allowed are arducopter:PATH ARGUMENTS, px4:PATH, each with a number before it (3*arducopter:PATH),"
    " and endpoints of simulations that run: tcp:127.0.0.1:5760,tcp:127.0.0.1:5770"
)


@dataclass(frozen=True)
class Program:
    """Simulation to be started: the program at ``path`` with the arguments ``words``.

    For a PX4, words of the form NAME=VALUE go to its environment.
    """

    flavour: str
    path: str
    words: tuple[str, ...] = ()


@dataclass(frozen=True)
class Running:
    """Running simulation: the companion's ``endpoint``, and another one, ``told``, for the true state."""

    flavour: str
    endpoint: str
    told: str


Autopilot = Program | Running


def add_option(parser: ArgumentParser) -> None:
    """Add ``--autopilots``, which may be given several times."""
    parser.add_argument(
        "--autopilots",
        action="append",
        default=[],
        metavar="WHAT",
        help="real firmware's simulations: arducopter:PATH ARGUMENTS, px4:PATH, 3*px4:PATH, or ENDPOINT,…",
    )


def autopilots(texts: Sequence[str]) -> tuple[Autopilot, ...]:
    """Return one autopilot for each vehicle, in the order of their system ids, from 1 on.

    Raises InputError, which names what is wrong.
    """
    found: list[Autopilot] = []
    alone = len(texts) == 1
    for text in texts:
        program = _PROGRAM.fullmatch(text.strip())
        if program is not None:
            found += _programs(text, *program.groups(), alone=alone)
        else:
            found += [_running(text, part) for part in _NEXT.split(text.strip())]
    if not FEWEST <= len(found) <= MOST:
        raise InputError(f"--autopilots: {_many(len(found))}; a trial has {FEWEST} to {MOST}")
    _distinct([one.endpoint for one in found if isinstance(one, Running)])
    return tuple(found)


def _programs(text: str, count: str | None, name: str, rest: str, *, alone: bool) -> list[Autopilot]:
    try:
        words = shlex.split(rest)
    except ValueError as error:
        raise _wrong(text, f"quotation marks do not match ({error})") from None
    if not words:
        raise _wrong(text, f"the path is missing; the form is {name}:PATH")
    if count is None and not alone:
        raise _wrong(text, f"say how many of each there are: 3*{name}:{words[0]}")
    if count is not None and re.fullmatch(r"[1-9][0-9]?", count) is None:
        raise _wrong(text, f"{count!r} is no number of vehicles; allowed are 1 to {MOST}")
    number = USUAL if count is None else int(count)
    return [Program(PROGRAMS[name], words[0], tuple(words[1:]))] * number


def _running(text: str, part: str) -> Running:
    said = _FLAVOUR.fullmatch(part)
    place, at, told = (part if said is None else said[2]).partition("@")
    endpoint = _endpoint(text, place)
    flavour = said[1] if said is not None else "ardupilot" if isinstance(endpoint, TcpOut) else "px4"
    if at:
        return Running(flavour, place, str(_endpoint(text, told)))
    if isinstance(endpoint, TcpOut):
        return Running(flavour, place, str(TcpOut(endpoint.host, endpoint.port + _SERIAL1)))
    if flavour == "px4":
        return Running(flavour, place, str(UdpIn("127.0.0.1", _GROUND)))
    raise _wrong(text, f"where the truth of {place} is told is missing: {place}@tcp:127.0.0.1:5762")


def _endpoint(text: str, place: str) -> TcpOut | UdpIn | UdpOut:
    try:
        endpoint = parse_endpoint(place)
    except EndpointError as error:
        if ":" not in place:
            raise _wrong(text, _FORMS) from None
        raise InputError(f"--autopilots: {error}") from None
    if not isinstance(endpoint, TcpOut | UdpIn | UdpOut):
        raise _wrong(
            text,
            f"{place} is no simulation's; allowed are tcp:, udpin: and udpout:, for a trial arms and takes"
            " off with nobody asked",
        )
    return endpoint


def _distinct(endpoints: list[str]) -> None:
    twice = {endpoint for endpoint in endpoints if endpoints.count(endpoint) > 1}
    if twice:
        raise InputError(f"--autopilots: {min(twice)} is named twice; each vehicle has its own endpoint")


def _wrong(text: str, why: str) -> InputError:
    return InputError(f"--autopilots {text!r}: {why}")


def _many(count: int) -> str:
    return "one vehicle" if count == 1 else f"{count} vehicles"
