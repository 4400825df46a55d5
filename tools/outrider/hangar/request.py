"""What is asked for: how many vehicles, which, where, and how fast time goes. All of it checked."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, isfinite, sqrt
from typing import Final, Literal, cast, get_args

from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import Vector
from outrider.errors import InputError
from outrider.resources import find
from outrider.scenario_places import Origin
from outrider.yaml_file import load
from sitl.autopilot_config import AutopilotConfig
from sitl.backends.physics import PhysicsName
from sitl.battery import BatteryConfig
from sitl.config import VehicleConfig
from sitl.profiles import ProfileName

FlavourName = Literal["ardupilot", "px4"]
StartupName = Literal["quick", "realistic"]

MOST_ID: Final = 254
"""255 is what ground stations take."""
_READY_AFTER: Final = {"ardupilot": 30.0, "px4": 20.0}
# s from boot; ArduCopter's GPS and EKF take about 40, PX4's less.


@dataclass(frozen=True)
class Request:
    """``speed``: simulated seconds per second of wall time. ``spacing`` (m) between vehicles, on a grid whose
    first corner is the ``origin``."""

    count: int
    first_id: int
    flavour: FlavourName
    vehicle: VehicleConfig
    sensors: ProfileName
    physics: PhysicsName
    startup: StartupName
    origin: Origin
    spacing: float
    speed: float
    seed: int

    @property
    def systems(self) -> range:
        """System ids."""
        return range(self.first_id, self.first_id + self.count)

    @property
    def frame(self) -> FleetFrame:
        """ENU at the origin."""
        return FleetFrame(self.origin.latitude, self.origin.longitude, self.origin.altitude)

    def place(self, index: int) -> Vector:
        """Where a vehicle stands (m, ENU): rows towards the east, one north of the other."""
        width = ceil(sqrt(self.count))
        return self.spacing * (index % width), self.spacing * (index // width), 0.0

    def config(self, index: int, epoch: int) -> AutopilotConfig:
        """The settings of a vehicle that boots at ``epoch`` (Unix µs)."""
        latitude, longitude, altitude = self.frame.to_geodetic(self.place(index))
        changes: dict[str, object] = {}
        if self.startup == "realistic":
            changes = {"startup": "in stages", "ready_after": _READY_AFTER[self.flavour]}
        return AutopilotConfig(
            system_id=self.first_id + index,
            flavour=self.flavour,
            latitude=latitude,
            longitude=longitude,
            altitude=altitude,
            streams="normal",
            sensors=self.sensors,
            physics=self.physics,
            battery=BatteryConfig(),
            epoch=epoch,
            **changes,
        )


def request(
    count: int,
    first_id: int,
    flavour: str,
    vehicle: str,
    sensors: str,
    physics: str,
    startup: str,
    origin: str | None,
    spacing: float,
    speed: float,
    seed: int,
) -> Request:
    """The options as a request. InputError with a line for each that is wrong."""
    wrong: list[str] = []

    def word(option: str, given: str, allowed: tuple[str, ...]) -> str:
        if given not in allowed:
            wrong.append(f"--{option} {given}: allowed are {', '.join(allowed)}")
        return given

    word("flavour", flavour, get_args(FlavourName))
    word("sensors", sensors, get_args(ProfileName))
    word("physics", physics, get_args(PhysicsName))
    word("startup", startup, get_args(StartupName))
    last = first_id + count - 1
    if last > MOST_ID:
        wrong.append(f"--count {count} from --first-id {first_id}: system ids go up to {MOST_ID}, not {last}")
    place = Origin() if origin is None else _origin(origin, wrong)
    if wrong:
        raise InputError(*wrong)
    return Request(
        count,
        first_id,
        cast("FlavourName", flavour),
        load(find("vehicles", vehicle), VehicleConfig),
        cast("ProfileName", sensors),
        cast("PhysicsName", physics),
        cast("StartupName", startup),
        place,
        spacing,
        speed,
        seed,
    )


def _origin(text: str, wrong: list[str]) -> Origin:
    """LAT,LON[,ALT]."""
    form = "LATITUDE,LONGITUDE[,ALTITUDE], degrees within ±89 and ±180, and m above the sea from −500 to 9000"
    try:
        numbers = [float(part) for part in text.split(",")]
        if len(numbers) not in (2, 3) or not all(map(isfinite, numbers)):
            raise ValueError
        fields = dict(zip(("latitude", "longitude", "altitude"), numbers, strict=False))
        return Origin.model_validate(fields)
    except ValueError:
        wrong.append(f"--origin {text}: allowed is {form}")
        return Origin()
