"""Application of the options of ``outrider swarm`` to a scenario."""

from __future__ import annotations

import re
from math import isfinite
from typing import NamedTuple, get_args

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from companion.config.companion import Avoidance
from companion.config.planning import MethodName
from outrider.errors import InputError
from outrider.scenarios.scenario import FlavourName, Points, Scenario
from outrider.yaml_files.schema_nodes import Schema

AVOIDANCES = get_args(Avoidance)
METHODS = get_args(MethodName)
FLAVOURS = get_args(FlavourName)
_MAX_REPLAN_US = 10_000_000
"""µs"""
_MAX_WIND_M_S = 50.0
"""m/s"""


class Options(NamedTuple):
    """Changes of a scenario by the command line; None keeps the file's value."""

    method: str | None = None
    avoidance: str | None = None
    planar: bool = False
    vehicles: int | None = None
    loss: float | None = None
    delay_ms: float | None = None
    sensors: str | None = None
    replan_hz: float | None = None
    wind: str | None = None
    physics: str | None = None
    flavour: str | None = None
    response: str | None = None


def apply(scenario: Scenario, options: Options) -> Scenario:
    """Return the scenario with the options' changes, checked again as a whole.

    Certified avoidance with the turning sense ``own`` changes the turning sense to ``right``. Raises
    InputError with the wrong option and its allowed values.
    """
    changes: dict[str, object] = {}
    companion: dict[str, object] = {}
    if options.method is not None:
        companion["methods"] = _methods(options.method)
    if options.avoidance is not None:
        if options.avoidance not in AVOIDANCES:
            raise InputError(f"--avoidance {options.avoidance}: allowed are {' and '.join(AVOIDANCES)}")
        companion["avoidance"] = options.avoidance
        if options.avoidance == "certified" and scenario.companion.turning_sense == "own":
            companion["turning_sense"] = "right"
    if options.planar:
        companion["planar"] = True
    if options.vehicles is not None:
        changes["vehicles"] = _vehicles(options.vehicles, scenario)
    if options.sensors is not None:
        changes["sensors"] = options.sensors
    if options.physics is not None:
        changes["physics"] = options.physics
    if options.flavour is not None:
        changes["flavour"] = _flavours(options.flavour)
    if options.response is not None:
        changes["autopilot"] = {**scenario.autopilot.model_dump(), "response": options.response}
    if options.wind is not None:
        changes["weather"] = {**scenario.weather.model_dump(), "wind": wind_of(options.wind)}
    if options.replan_hz is not None:
        replan = _replan_us(options.replan_hz, scenario)
        companion["rates"] = {**scenario.companion.rates.model_dump(), "replan_us": replan}
    if options.loss is not None or options.delay_ms is not None:
        links = scenario.links.model_dump()
        for link in ("swarm", "target"):
            if options.loss is not None:
                links[link]["loss"] = options.loss
            if options.delay_ms is not None:
                links[link]["delay_ms"] = options.delay_ms
        changes["links"] = links
    if companion:
        changes["companion"] = {**scenario.companion.model_dump(), **companion}
    if not changes:
        return scenario
    try:
        return Scenario.model_validate({**scenario.model_dump(), **changes})
    except ValidationError as error:
        # An option may change several links; their equal errors are reported once.
        faults = dict.fromkeys(_fault(one, options) for one in error.errors())
        raise InputError(*faults) from None


def named(options: Options) -> str:
    """Return the options, except method and avoidance, as part of a file name: ``loss0.2-delay100``.

    It is empty without such options.
    """
    said = {
        "planar": "planar" if options.planar else None,
        "vehicles": options.vehicles,
        "loss": options.loss,
        "delay": options.delay_ms,
        "": options.sensors,
        "replan": options.replan_hz,
        "wind": options.wind,
        "physics": options.physics,
        "flavour": options.flavour,
        "response": options.response,
    }
    parts = []
    for word, value in said.items():
        if value is not None:
            text = f"{value:g}" if isinstance(value, float) else str(value)
            parts.append(text if word in ("", "planar", "physics", "flavour", "response") else word + text)
    return re.sub(r"[^A-Za-z0-9._-]", "_", "-".join(parts))


def _fault(error: ErrorDetails, options: Options) -> str:
    """Return the error as text about its option; about all given options if they are inconsistent."""
    if error["type"] == "value_error":
        given = [
            f"{_option(name)} {value}"
            for name, value in options._asdict().items()
            if value is not None and value is not False
        ]
        return f"{' '.join(given)}: {error['ctx']['error']}"
    schema = Scenario.model_json_schema()
    node = Schema(schema, schema)
    for part in error["loc"]:
        node = node.child(part)
    words = [str(part) for part in error["loc"] if isinstance(part, str)]
    return f"{_option(words[-1])} {getattr(options, words[-1])}: allowed: {node.describe()}"


def _option(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def _vehicles(count: int, scenario: Scenario) -> int:
    if isinstance(scenario.starts, Points) and count != (places := len(scenario.starts.at)):
        raise InputError(
            f"--vehicles {count}: the scenario's starts.at has {places} places; allowed: {places}"
        )
    return count


def _replan_us(rate: float, scenario: Scenario) -> int:
    """Return the period (µs) of ``rate`` plans per second.

    Raises InputError if it is out of bounds or not a whole number of ticks.
    """
    tick, least = scenario.timing.base_tick_us, scenario.timing.companion_us
    if not 1e6 / _MAX_REPLAN_US <= rate <= 1000.0:
        raise InputError(f"--replan-hz {rate:g}: allowed: {1e6 / _MAX_REPLAN_US:g} to {1e6 / least:g}")
    period = round(1e6 / rate)
    if period % tick == 0 and period >= least:
        return period
    near = [max(period // tick * tick, least), min(max(period // tick * tick + tick, least), _MAX_REPLAN_US)]
    best = min(near, key=lambda one: abs(1e6 / one - rate))
    raise InputError(
        f"--replan-hz {rate:g}: a plan's period is a whole number of ticks of {tick} µs, and {least} µs or "
        f"more; the nearest allowed: {_shortest(best)}"
    )


def _shortest(period: int) -> str:
    """Return a rate (Hz) that rounds to this period (µs), with as few digits as possible."""
    texts = (f"{1e6 / period:.{decimals}f}" for decimals in range(18))
    return next(text for text in texts if float(text) and round(1e6 / float(text)) == period)


def wind_of(text: str) -> list[float]:
    """Return [east, north, up] from ``V`` m/s towards east, ``EAST,NORTH`` or ``EAST,NORTH,UP``.

    Raises InputError for anything else.
    """
    try:
        parts = [float(word) for word in text.split(",")]
    except ValueError:
        parts = []
    if not 1 <= len(parts) <= 3 or not all(isfinite(part) and abs(part) <= _MAX_WIND_M_S for part in parts):
        raise InputError(
            f"--wind {text}: allowed is a speed in m/s (towards east), or EAST,NORTH or EAST,NORTH,UP, each "
            f"from -{_MAX_WIND_M_S:g} to {_MAX_WIND_M_S:g}"
        )
    return parts + [0.0] * (3 - len(parts))


def _flavours(text: str) -> str | tuple[str, ...]:
    names = tuple(text.split(","))
    for name in names:
        if name not in FLAVOURS:
            raise InputError(
                f"--flavour {text}: {name!r} is no firmware; allowed are {' and '.join(FLAVOURS)}, or several"
                " joined by commas"
            )
    return names[0] if len(names) == 1 else names


def _methods(text: str) -> tuple[str, ...]:
    names = tuple(text.split("+"))
    for name in names:
        if name not in METHODS:
            raise InputError(
                f"--method {text}: {name!r} is no method; allowed are {', '.join(METHODS)}, joined by +"
            )
    if len(set(names)) < len(names):
        raise InputError(f"--method {text}: a method is there twice; allowed: once")
    return names
