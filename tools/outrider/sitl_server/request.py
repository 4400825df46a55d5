"""Options of ``outrider sitl``, and the checked request: vehicles, origin, physics, simulation speed."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from math import ceil, isfinite, sqrt
from pathlib import Path
from typing import Final, Literal, cast, get_args

from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.key import Key
from mavlink_bridge.messages import Vector
from mavlink_bridge.node import Node
from mavlink_bridge.wire.signing import Signing
from outrider.errors import InputError
from outrider.key_files import key_of
from outrider.resources import find
from outrider.scenarios.cameras import CameraFile
from outrider.scenarios.options import wind_of
from outrider.scenarios.places import Origin, PathTarget
from outrider.simulation import sight
from outrider.simulation.targets import StandingTarget, Target, Walking
from outrider.yaml_files.yaml_file import load
from sitl.autopilot.saved import Saved
from sitl.backends.physics import PhysicsName
from sitl.config.autopilot import AutopilotConfig
from sitl.config.gains import ResponseName
from sitl.environment.weather import WeatherConfig
from sitl.estimation.profiles import ProfileName
from sitl.node import Autopilot
from sitl.vehicle.battery import BatteryConfig
from sitl.vehicle.config import VehicleConfig

FlavourName = Literal["ardupilot", "px4"]
StartupName = Literal["quick", "realistic"]

MOST_ID: Final = 254
"""Highest system id of a vehicle: ground stations use 255."""
_READY_AFTER_S: Final = {"ardupilot": 30.0, "px4": 20.0}
# Time (s) from boot to a known position; a real ArduCopter takes about 40 s, PX4 less.

_PLACE: Final = "LATITUDE,LONGITUDE[,ALTITUDE], ±89 and ±180 degrees, −500 to 9000 m above the sea"


@dataclass(frozen=True)
class Options:
    """Options of the command line, unchecked."""

    count: int = 1
    first_id: int = 1
    flavour: str = "ardupilot"
    vehicle: str = "firefly"
    sensors: str = "truth"
    physics: str = "own"
    startup: str = "quick"
    response: str = "firmware"
    origin: str | None = None
    wind: str | None = None
    spacing: float = 3.0
    columns: int | None = None
    speedup: float = 1.0
    seed: int = 1
    signing_key: Path | None = None
    camera: str | None = None


@dataclass(frozen=True)
class Request:
    """Checked request.

    ``speed``: simulated seconds per second of wall time. ``spacing``: distance (m) between neighbours on the
    start grid; ``columns``: vehicles in a row of the grid, whose first vehicle is at ``origin``. ``key``: if
    given, vehicles sign with it and accept only messages signed with it, except those of telemetry radios.
    ``camera``: what the vehicles' cameras are and see, None without.
    """

    count: int
    first_id: int
    flavour: FlavourName
    vehicle: VehicleConfig
    sensors: ProfileName
    physics: PhysicsName
    startup: StartupName
    response: ResponseName
    origin: Origin
    weather: WeatherConfig
    spacing: float
    columns: int
    speed: float
    seed: int
    key: Key | None = None
    camera: CameraFile | None = None

    @property
    def systems(self) -> range:
        """System ids of the vehicles."""
        return range(self.first_id, self.first_id + self.count)

    @property
    def frame(self) -> FleetFrame:
        """ENU frame at the origin."""
        return FleetFrame(self.origin.latitude, self.origin.longitude, self.origin.altitude)

    def place(self, index: int) -> Vector:
        """Return the start position of vehicle ``index`` (m, ENU).

        Rows run east; each next row is further north.
        """
        return self.spacing * (index % self.columns), self.spacing * (index // self.columns), 0.0

    def autopilot(self, index: int, epoch: int, saved: Saved) -> Autopilot:
        """Return vehicle ``index`` (from 0), which boots at ``epoch`` (Unix µs) with the state ``saved``."""
        vehicle, scene = self.vehicle, None
        if self.camera is not None:
            vehicle = vehicle.model_copy(update={"camera": self.camera.camera})
            others = set(self.systems) - {self.first_id + index}
            scene = sight.scene(self.target_system, self.camera.obstacles, (), sorted(others), self.vehicle)
        return Autopilot(
            self._config(index, epoch),
            vehicle,
            self.frame,
            self.seed,
            weather=self.weather,
            saved=saved,
            signing=None if self.key is None else Signing(self.key),
            scene=scene,
        )

    @property
    def target_system(self) -> int:
        """System id of the tracked object, in the ground truth alone: none of the vehicles'."""
        return next(system for system in range(MOST_ID + 1, 0, -1) if system not in self.systems)

    def target(self) -> Node | None:
        """Return the tracked object, which shows itself to the cameras; None without cameras."""
        if self.camera is None:
            return None
        config = self.camera.target
        node: Target = (
            Walking(config, self.frame)
            if isinstance(config, PathTarget)
            else StandingTarget(config, self.frame)
        )
        node.begin(0)
        return sight.Shown(node, self.target_system, node.position, self.frame)

    def _config(self, index: int, epoch: int) -> AutopilotConfig:
        latitude, longitude, altitude = self.frame.to_geodetic(self.place(index))
        changes: dict[str, object] = {}
        if self.startup == "realistic":
            ready = _READY_AFTER_S[self.flavour]
            changes = {"startup": "in stages", "ready_after": ready}
        return AutopilotConfig(
            system_id=self.first_id + index,
            flavour=self.flavour,
            latitude=latitude,
            longitude=longitude,
            altitude=altitude,
            sensors=self.sensors,
            physics=self.physics,
            response=self.response,
            # ArduPilot's default BATT_LOW_VOLT of 10.5 V suits three cells; PX4's thresholds are relative.
            battery=BatteryConfig(cells=3 if self.flavour == "ardupilot" else 4),
            epoch=epoch,
            streams="normal",
            **changes,
        )


def checked(options: Options) -> Request:
    """Check the options and return the request.

    Raises InputError with one line for each wrong word, number, system id or origin; faults of the wind, the
    vehicle or the key raise it one at a time. Raises ModuleNotFoundError for ``jsbsim`` if not installed.
    """
    words: dict[str, tuple[str, ...]] = {
        "flavour": get_args(FlavourName),
        "sensors": get_args(ProfileName),
        "physics": get_args(PhysicsName),
        "startup": get_args(StartupName),
        "response": get_args(ResponseName),
    }
    wrong = [
        f"--{name} {given}: allowed are {', '.join(allowed)}"
        for name, allowed in words.items()
        if (given := getattr(options, name)) not in allowed
    ]
    wrong += [
        f"--{name} {given}: allowed is a finite number"
        for name in ("spacing", "speedup")
        if not isfinite(given := getattr(options, name))
    ]
    last = options.first_id + options.count - 1
    if last > MOST_ID:
        wrong.append(
            f"--count {options.count} from --first-id {options.first_id}: system ids would go up to {last}; "
            f"the highest allowed is {MOST_ID}, because ground stations use 255"
        )
    origin = Origin() if options.origin is None else _origin(options.origin)
    if origin is None:
        wrong.append(f"--origin {options.origin}: allowed is {_PLACE}")
    if wrong or origin is None:
        raise InputError(*wrong)
    weather = WeatherConfig()
    if options.wind is not None:
        weather = WeatherConfig.model_validate({"wind": wind_of(options.wind)})
    if options.physics == "jsbsim":
        # A missing package is reported before anything is opened.
        import_module("jsbsim")
    return Request(
        options.count,
        options.first_id,
        cast("FlavourName", options.flavour),
        load(find("vehicles", options.vehicle), VehicleConfig),
        cast("ProfileName", options.sensors),
        cast("PhysicsName", options.physics),
        cast("StartupName", options.startup),
        cast("ResponseName", options.response),
        origin,
        weather,
        options.spacing,
        ceil(sqrt(options.count)) if options.columns is None else options.columns,
        options.speedup,
        options.seed,
        None if options.signing_key is None else key_of(options.signing_key),
        None if options.camera is None else load(find("cameras", options.camera), CameraFile),
    )


def _origin(text: str) -> Origin | None:
    """Parse ``text`` in the form of ``_PLACE``; return None if the form or a value is wrong."""
    try:
        numbers = [float(part) for part in text.split(",")]
        if len(numbers) not in (2, 3):
            return None
        return Origin.model_validate(dict(zip(("latitude", "longitude", "altitude"), numbers, strict=False)))
    except ValueError:
        return None
