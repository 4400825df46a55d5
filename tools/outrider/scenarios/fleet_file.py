"""Fleet file: the settings that all vehicles of a certified flight have in common, as preflight writes them.

A companion file names it (``fleet: PATH``). A setting of the companion file that differs is a fault: nothing
is silently replaced. A setting that the companion file leaves out has the value of the fleet file.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import yaml
from pydantic import BaseModel, Field, ValidationError, model_validator

from companion.avoidance.certified.fingerprint import fingerprint
from companion.avoidance.certified.margins import between
from companion.config import CompanionConfig
from companion.config.certified import SystemId
from companion.config.planning import Bounds, Floors
from companion.values.settings import Positive, Settings, WireStep
from outrider.errors import Fault, InputError
from outrider.scenarios.fly_config import FleetOrigin, FlyConfig
from outrider.yaml_files.yaml_file import load

_DISTANCE_TOLERANCE = 1e-3
"""Difference (m) up to which the least distance of the file counts as that of its settings."""
_DURATION = Field(ge=0.0, le=1e6)
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Milliseconds = Annotated[float, _DURATION]


class VehicleFigures(Settings):
    """Figures of one vehicle, as it measured them."""

    system: SystemId
    firmware: str = Field(max_length=40)
    position_sigma: float | None = Field(description="m, as receiver and estimator report it; null: unknown")
    clock_us: int | None = Field(ge=0, description="bound of the error of its fleet time, µs; null: unknown")
    tube: float | None = Field(
        description="m, largest tracking error in a recorded flight; null: not measured"
    )


class LinkFigures(Settings):
    """Figures of the link from one vehicle to another, as the receiver measured them."""

    sender: SystemId
    receiver: SystemId
    loss: Share
    jitter_ms: Milliseconds = Field(description="95 % of the messages took at most so much longer")
    round_trip_ms: Milliseconds | None = Field(description="median; null: no request was answered")


class Measurement(Settings):
    """When and how the figures were measured."""

    at: str = Field(max_length=40, description="UTC of the last report")
    seconds: Annotated[float, _DURATION]
    configured: tuple[str, ...] = Field(
        max_length=16, description="settings that were not measured on all vehicles"
    )
    vehicles: tuple[VehicleFigures, ...] = Field(max_length=255)
    links: tuple[LinkFigures, ...] = Field(max_length=65_025)


class FleetFile(Settings):
    """Contents of a fleet file. ``fingerprint`` and ``distance`` must be those of the settings."""

    fingerprint: str = Field(pattern="^[0-9a-f]{8}$", description="of the settings; see docs/certified.md")
    distance: Positive = Field(description="m, least distance between two plans, from the settings")
    roster: tuple[SystemId, ...] = Field(
        min_length=2, max_length=255, description="system ids that take part"
    )
    origin: FleetOrigin
    planar: bool
    steps: int = Field(ge=2, le=15, description="companion.horizon.steps")
    dt_us: WireStep
    epoch_us: int = Field(gt=0, le=2_000_000, multiple_of=4)
    d_min: Positive
    tube: Positive
    drift: Positive
    sigmas: float = Field(ge=0.0, le=6.0)
    position_sigma: float = Field(ge=0.0, le=5.0)
    clock_us: int = Field(ge=0, le=100_000)
    v_max: Bounds
    v_min: Floors | None = Field(None, description="m/s, least velocity on each axis; null: -v_max")
    plane_shift: float | None = Field(
        None, ge=0.0, le=0.9, description="certified.plane_shift; null: the default of `planar`"
    )
    fleet_time: Literal["own", "measured"]
    reference: SystemId | None
    measured: Measurement

    @model_validator(mode="after")
    def _untouched(self) -> FleetFile:
        if len(set(self.roster)) < len(self.roster):
            raise ValueError("roster: names a vehicle twice; allowed: each system id once")
        if self.epoch_us % self.dt_us:
            raise ValueError(f"epoch_us: {self.epoch_us} must be a multiple of dt_us = {self.dt_us}")
        # Other rules of these settings depend on the rest of a companion file.
        config = CompanionConfig.model_construct(**_replaced(CompanionConfig(), self))
        found = fingerprint_of(config, self.origin)
        if found != self.fingerprint:
            raise ValueError(
                f"fingerprint: {self.fingerprint} is not that of these settings, which have {found}: the file"
                " was changed after it was measured, or is of another version; needed: the file as outrider"
                " preflight of this version writes it"
            )
        distance = distance_of(config)
        if abs(distance - self.distance) > _DISTANCE_TOLERANCE:
            raise ValueError(f"distance: {self.distance} is not that of these settings, {distance:.3f}")
        return self


class _Common(NamedTuple):
    """Setting of the companion file at ``path``, and its value in the fleet file."""

    path: tuple[str, ...]
    value: Any


def fingerprint_of(config: CompanionConfig, origin: FleetOrigin) -> str:
    """Return the fingerprint of common settings as 8 hexadecimal digits."""
    return f"{fingerprint(config, origin.frame):08x}"


def distance_of(config: CompanionConfig) -> float:
    """Return the least distance (m) between two plans."""
    return between(config.certified, config.field, config.limits)


def settings_of(config: CompanionConfig, origin: FleetOrigin, measured: Measurement) -> FleetFile:
    """Return the fleet file of a companion's settings, with ``certified.fleet`` as the roster."""
    certified = config.certified
    return FleetFile(
        fingerprint=fingerprint_of(config, origin),
        distance=round(distance_of(config), 6),
        roster=tuple(sorted(set(certified.fleet))),
        origin=origin,
        planar=config.planar,
        steps=config.horizon.steps,
        dt_us=certified.dt_us,
        epoch_us=certified.epoch_us,
        d_min=config.field.d_min,
        tube=certified.tube,
        drift=certified.drift,
        sigmas=certified.sigmas,
        position_sigma=config.field.position_sigma,
        clock_us=certified.clock_us,
        v_max=config.limits.v_max,
        v_min=config.limits.v_min,
        plane_shift=certified.plane_shift,
        fleet_time=certified.fleet_time,
        reference=certified.time_sources.reference,
        measured=measured,
    )


def text_of(file: FleetFile) -> str:
    """Return the text of a fleet file; the same values give the same text."""
    # A line for these only where they are stated.
    unstated = {name for name in ("v_min", "plane_shift") if getattr(file, name) is None}
    left_out = {"fingerprint", *unstated}
    document = file.model_dump(mode="json", exclude=left_out)
    body = yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=120)
    return (
        f"# Written by outrider preflight: the settings that the vehicles {', '.join(map(str, file.roster))}"
        " have in common.\n# Name it in each companion file (fleet: PATH). Do not edit it: the fingerprint"
        # In quotes, because digits and an e would be a number.
        f" would not fit.\nfingerprint: '{file.fingerprint}'\n{body}"
    )


def with_fleet_file(config: FlyConfig, path: Path) -> FlyConfig:
    """Return the settings of the companion file ``path``, completed from the fleet file that it names.

    Without one they are returned unchanged. Raises InputError with one fault for each setting that both files
    state differently, and if the own id is not in the roster.
    """
    if config.fleet is None:
        return config
    place = path.parent / config.fleet
    if not place.is_file():
        raise InputError(Fault(str(path), f"fleet: {place}: there is no such file"))
    fleet = load(place, FleetFile)
    faults = [Fault(str(path), what) for what in _conflicts(config, fleet, place)]
    if config.system and config.system not in fleet.roster:
        roster = ", ".join(map(str, fleet.roster))
        faults.append(
            Fault(
                str(place), f"roster: {roster} lacks the own system id {config.system}; allowed: one of these"
            )
        )
    if faults:
        raise InputError(*faults)
    try:
        companion = _companion(config.companion, fleet)
    except ValidationError as error:
        raise InputError(Fault(str(path), f"does not go with {place}: {_reasons(error)}")) from None
    return config.model_copy(update={"companion": companion, "origin": fleet.origin})


def _conflicts(config: FlyConfig, fleet: FleetFile, place: Path) -> Iterator[str]:
    """Yield a description of each setting that the companion file states otherwise than the fleet file."""
    if config.origin != fleet.origin:
        yield f"origin: is not that of {place}, {_words(fleet.origin)}; allowed: this one"
    for path, value in _common(fleet):
        stated = stated_at(config.companion, path)
        if stated and not _same(stated[0], value):
            name, here, there = ".".join(("companion", *path)), _words(stated[0]), _words(value)
            yield f"{name}: is {here}, and {there} in {place}; allowed: this one, or no line"


def _common(fleet: FleetFile) -> tuple[_Common, ...]:
    return (
        _Common(("planar",), fleet.planar),
        _Common(("horizon", "steps"), fleet.steps),
        _Common(("certified", "dt_us"), fleet.dt_us),
        _Common(("certified", "epoch_us"), fleet.epoch_us),
        _Common(("field", "d_min"), fleet.d_min),
        _Common(("certified", "tube"), fleet.tube),
        _Common(("certified", "drift"), fleet.drift),
        _Common(("certified", "sigmas"), fleet.sigmas),
        _Common(("field", "position_sigma"), fleet.position_sigma),
        _Common(("certified", "clock_us"), fleet.clock_us),
        _Common(("limits", "v_max"), fleet.v_max),
        _Common(("limits", "v_min"), fleet.v_min),
        _Common(("certified", "plane_shift"), fleet.plane_shift),
        _Common(("certified", "fleet_time"), fleet.fleet_time),
        _Common(("certified", "time_sources", "reference"), fleet.reference),
        _Common(("certified", "fleet"), tuple(sorted(fleet.roster))),
    )


def stated_at(model: BaseModel, path: tuple[str, ...]) -> tuple[Any, ...]:
    """Return the value at ``path``, alone in a tuple, if the file states it; otherwise nothing."""
    value: Any = model
    for name in path:
        if not isinstance(value, BaseModel) or name not in value.model_fields_set:
            return ()
        value = getattr(value, name)
    return (value,)


def _same(one: Any, two: Any) -> bool:
    if isinstance(one, tuple) and isinstance(two, tuple):
        return sorted(set(one)) == sorted(set(two)) if _are_ids(two) else one == two
    return bool(one == two)


def _are_ids(values: tuple[Any, ...]) -> bool:
    return all(isinstance(value, int) for value in values)


def _reasons(error: ValidationError) -> str:
    return "; ".join(str(one["msg"]) for one in error.errors(include_url=False, include_input=False))


def _words(value: Any) -> str:
    if isinstance(value, FleetOrigin):
        return f"{value.latitude}, {value.longitude}, {value.altitude}"
    if isinstance(value, tuple):
        return f"[{', '.join(map(str, value))}]"
    return str(value)


def _companion(config: CompanionConfig, fleet: FleetFile) -> CompanionConfig:
    """Return ``config`` with the settings of ``fleet``; raises ValidationError if they break its rules."""
    parts = _replaced(config, fleet)
    document = config.model_copy(update=parts).model_dump()
    # The field begins beyond d_min; a file that leaves d_safe out takes no part in this.
    if config.field.d_safe <= fleet.d_min and "d_safe" not in config.field.model_fields_set:
        document["field"]["d_safe"] = 2.0 * fleet.d_min
    return CompanionConfig.model_validate(document)


def _replaced(model: BaseModel, fleet: FleetFile) -> dict[str, Any]:
    """Return the fields of ``model``, a companion's settings, with the settings of ``fleet``; unchecked."""
    found: dict[str, Any] = {name: getattr(model, name) for name in type(model).model_fields}
    for path, value in _common(fleet):
        found[path[0]] = _with(found[path[0]], path[1:], value)
    return found


def _with(part: Any, path: tuple[str, ...], value: Any) -> Any:
    if not path:
        return value
    inner = _with(getattr(part, path[0]), path[1:], value)
    return part.model_copy(update={path[0]: inner})
