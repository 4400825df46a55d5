"""Engine of the JSBSim backend with one vehicle: it takes motor commands and wind and gives measured motion.

JSBSim is imported when the first engine is made. The extra ``sitl`` installs JSBSim where a wheel exists.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from mavlink_bridge.messages import Vector
from sitl.backends.jsbsim_model import FOOT, aircraft, command_property, left_property, motor_property
from sitl.backends.jsbsim_place import euler_angles, rotation_of
from sitl.backends.physics import BackendError
from sitl.vehicle.config import VehicleConfig
from sitl.vehicle.pipeline import STATE_SIZE

if TYPE_CHECKING:
    from sitl.backends.jsbsim_place import Place
    from sitl.vehicle.airframe import FloatArray

MEASURED: Final = (
    *(f"position/ecef-{axis}-ft" for axis in "xyz"),
    *(f"velocities/ecef-{axis}-fps" for axis in "xyz"),
    *(f"attitude/{angle}-rad" for angle in ("phi", "theta", "psi")),
    "position/lat-geod-rad",
    "position/long-gc-rad",
    *(f"velocities/{rate}-rad_sec" for rate in "pqr"),
    *(f"forces/fb{axis}-total-lbs" for axis in "xyz"),
    *(f"moments/{axis}-total-lbsft" for axis in "lmn"),
    "forces/fbz-gear-lbs",
)
"""Properties read after each step, before the motors' speeds."""
GROUND: Final = len(MEASURED) - 1
"""Index of the ground's force: gear/wow does not count contact points without wheels."""

_AIR: Final = ("north", "east", "down")

# JSBSim's codes of integrators. With its default integrators, the attitude of a free tumble is wrong by 13°
# after 10 s.
_EULER, _ADAMS_BASHFORTH_3, _BUSS_2 = 1.0, 4.0, 7.0
_RATES: Final = ("simulation/integrator/rate/rotational", "simulation/integrator/rate/translational")
_POSITIONS: Final = {
    "simulation/integrator/position/rotational": _BUSS_2,
    "simulation/integrator/position/translational": _ADAMS_BASHFORTH_3,
}
_MILSPEC: Final = 3.0
_DEBUG_VARIABLE: Final = "JSBSIM_DEBUG"


class Air(NamedTuple):
    """Effects of the air that JSBSim simulates itself."""

    w20: float = 0.0  # m/s, wind at 20 feet of its turbulence (MIL-F-8785C); 0 for none
    severity: int = 0  # for its table above 1000 feet over the sea: 3 light, 4 moderate, 6 severe
    seed: int = 0
    isa: bool = False  # density, and with it thrust and drag, falls with height


STILL: Final = Air()


class Engine:
    """JSBSim instance.

    ``measured`` (len(MEASURED) + n,) holds the properties after the last step, in JSBSim's feet and pounds,
    then the motors' speeds (rad/s). ``place`` (12,) is a place row of ``jsbsim_pilot``.
    """

    def __init__(
        self, config: VehicleConfig, place: Place, state: FloatArray, ground: float, air: Air
    ) -> None:
        """Start with the motion and motor speeds of a ``state`` row of ``sitl.vehicle.pipeline`` (site NED).

        The ground is level; below the start it is at z = ``ground`` (m, site NED). Raises BackendError.
        """
        n = len(config.rotors)
        self._name = config.name
        self._fdm = _loaded(config, isa=air.isa)
        self._fdm.set_dt(config.physics_period * 1e-6)
        self._commands = [self._node(command_property(i)) for i in range(n)]
        self._left = [self._node(left_property(i)) for i in range(n)]
        motors = [self._node(motor_property(i)) for i in range(n)]
        self._readings = [self._node(name) for name in MEASURED] + motors
        self._wind = [self._node(f"atmosphere/wind-{axis}-fps") for axis in _AIR]
        self._total_wind = [self._node(f"atmosphere/total-wind-{axis}-fps") for axis in _AIR]
        self._rates = [self._node(name) for name in _RATES]
        self._standing: bool | None = None
        self.measured = np.zeros(len(MEASURED) + n)
        for name, code in _POSITIONS.items():
            self._set(name, code)
        self._begin(place, state, ground, motors)
        self._set_turbulence(air)
        self._read()
        # JSBSim finds a latitude only to within 0.1 mm; the origin is set so that the start is where
        # requested.
        origin = FOOT * self.measured[0:3] - state[0:3] @ place.axes
        self.place = np.concatenate((origin, place.axes.ravel()))

    def step(self, commanded: list[float], wind: list[float]) -> None:
        """Run one physics step with the motor commands held at ``commanded`` (n,) (rad/s).

        JSBSim adds its own turbulence to ``wind`` (m/s, NED). Raises BackendError.
        """
        for node, speed in zip(self._commands, commanded, strict=True):
            node.set_double_value(speed)
        for node, part in zip(self._wind, wind, strict=True):
            node.set_double_value(part / FOOT)
        if not self._fdm.run():
            raise BackendError(f"JSBSim stopped at {self._fdm.get_sim_time():.3f} s with {self._name}")
        self._read()

    def leave(self, rotor: int, left: float) -> None:
        """Limit a rotor to the fraction ``left`` (0…1) of its motor's speed from now on."""
        self._left[rotor].set_double_value(left)

    @property
    def time(self) -> float:
        """Simulation time since the start (s)."""
        return float(self._fdm.get_sim_time())

    @property
    def air(self) -> Vector:
        """Velocity of the air (m/s, NED), turbulence included."""
        north, east, down = (FOOT * node.get_double_value() for node in self._total_wind)
        return north, east, down

    def _read(self) -> None:
        self.measured[:] = [node.get_double_value() for node in self._readings]
        standing = bool(self.measured[GROUND] != 0.0)
        if standing is not self._standing:
            # JSBSim computes friction as the force that stops the vehicle in one Euler step. With an
            # integrator that uses earlier accelerations, the vehicle slides for ever.
            for node in self._rates:
                node.set_double_value(_EULER if standing else _ADAMS_BASHFORTH_3)
            self._standing = standing

    def _begin(self, place: Place, state: FloatArray, ground: float, motors: list[Any]) -> None:
        here = place.geodetic(state[0:3])
        below = place.geodetic((state[0], state[1], ground))
        local = place.local_axes(here)
        rotation = local @ rotation_of(state[6:10])
        velocity = (local @ state[3:6]).tolist()
        for name, value in (
            ("lat-geod-deg", here.latitude),
            ("long-gc-deg", here.longitude),
            ("terrain-elevation-ft", below.altitude / FOOT),
            # JSBSim's h-sl is not along the vertical: 3 mm less at 500 m.
            ("h-agl-ft", (here.altitude - below.altitude) / FOOT),
            *zip(("phi-rad", "theta-rad", "psi-true-rad"), euler_angles(rotation), strict=True),
            *((f"v{axis}-fps", part / FOOT) for axis, part in zip("ned", velocity, strict=True)),
            *((f"{axis}-rad_sec", part) for axis, part in zip("pqr", state[10:13].tolist(), strict=True)),
        ):
            self._set(f"ic/{name}", value)
        speeds = state[STATE_SIZE : STATE_SIZE + len(motors)].tolist()
        for motor, command, speed in zip(motors, self._commands, speeds, strict=True):
            motor.set_double_value(speed)
            command.set_double_value(speed)
        if not self._fdm.run_ic():
            raise BackendError(f"JSBSim does not take the start of {self._name}: {here}")

    def _set_turbulence(self, air: Air) -> None:
        """Set the turbulence, after the start, which resets the wind."""
        self._set("simulation/randomseed", float(air.seed))
        self._set("atmosphere/turb-type", _MILSPEC if air.w20 else 0.0)
        self._set("atmosphere/turbulence/milspec/windspeed_at_20ft_AGL-fps", air.w20 / FOOT)
        self._set("atmosphere/turbulence/milspec/severity", float(air.severity))

    def _set(self, name: str, value: float) -> None:
        self._node(name).set_double_value(value)

    def _node(self, name: str) -> Any:
        """Return an existing property; raise BackendError if it does not exist.

        JSBSim itself creates a property for an unknown name.
        """
        node = self._fdm.get_property_manager().get_node(name)
        if node is None:
            raise BackendError(f"this JSBSim has no property {name}; allowed is version 1.2.3 or newer")
        return node


def _loaded(config: VehicleConfig, *, isa: bool) -> Any:
    """Return a JSBSim with the model of a vehicle, without console output."""
    import jsbsim

    with tempfile.TemporaryDirectory(prefix="outrider-jsbsim-") as folder, _silence():
        root = Path(folder)
        for name in ("engine", "systems"):
            (root / name).mkdir()
        # A valid file name, whatever the vehicle's name.
        model = root / "aircraft" / "vehicle"
        model.mkdir(parents=True)
        (model / "vehicle.xml").write_text(aircraft(config, isa=isa), encoding="utf-8")
        fdm = jsbsim.FGFDMExec(folder)
        if not fdm.load_model("vehicle"):
            raise BackendError(f"JSBSim {jsbsim.__version__} cannot load the model of {config.name}")
    return fdm


@contextmanager
def _silence() -> Iterator[None]:
    """Suppress JSBSim's output; JSBSim reads the debug level from the environment when it is created."""
    before = os.environ.get(_DEBUG_VARIABLE)
    os.environ[_DEBUG_VARIABLE] = "0"
    try:
        yield
    finally:
        if before is None:
            del os.environ[_DEBUG_VARIABLE]
        else:
            os.environ[_DEBUG_VARIABLE] = before
