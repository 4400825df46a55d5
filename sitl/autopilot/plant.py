"""Vehicle in its air, with its estimator: it takes the guidance and gives motion and estimate."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from mavlink_bridge.messages import Vector
from sitl.autopilot.course import Course, Level, believed
from sitl.autopilot.guidance import Guidance
from sitl.backends.selection import Start, physics
from sitl.config.autopilot import AutopilotConfig
from sitl.environment.weather import Weather, WeatherConfig
from sitl.estimation.profiles import PROFILES
from sitl.estimation.sensors import Estimate, Sensors
from sitl.values.origin import Origin
from sitl.values.setpoints import ZERO
from sitl.vehicle.config import VehicleConfig
from sitl.vehicle.multirotor import Reference, VehicleState

# Period after which the reference is renewed (µs), because real position loops run at 50 to 100 Hz; the
# vehicle's controller extrapolates it in between. The period is rounded down to whole physics steps, but is
# at least one of them.
_RENEWAL_US: Final = 10_000
_NOTHING: Final = np.zeros(3)
_NOTHING.flags.writeable = False


class Plant:
    """Simulation of the vehicle and its guidance, in strides on a fixed grid from time 0.

    A stride consists of the physics steps that have the same reference.

    ``sensors`` is the estimator, ``course`` generates the tracked reference.
    """

    def __init__(
        self,
        config: AutopilotConfig,
        vehicle: VehicleConfig,
        weather: WeatherConfig,
        guidance: Guidance,
        origin: Origin,
        position_timeout: float,
        seed: int,
    ) -> None:
        """Start at rest at ``origin``, or at the height above it in ``config``.

        ``position_timeout`` and ``seed`` are those of ``Sensors``.
        """
        ground = float(origin.position[2]) + vehicle.rest_height
        start = origin.motion_to_site([(0.0, 0.0, -config.start_height)])[0]
        flying = config.start_height > 0.0
        begin = Start(start, config.yaw + origin.turn, ground, flying)
        self.vehicle = physics(config.physics, vehicle, begin, origin.site, weather, seed, config.system_id)
        self.course = Course(guidance, origin)
        profile = PROFILES[config.sensors]
        self.sensors = Sensors(profile, origin, self.vehicle.state, position_timeout, seed, config.system_id)
        air = Weather(weather, seed, config.system_id)
        self._weather = None if air.still else air
        self._guidance = guidance
        self._origin = origin
        self._ground = ground
        self._level = Level.of(vehicle)
        self._period = vehicle.physics_period
        self._stride = max(1, _RENEWAL_US // self._period)
        self._resets = 0
        self._steps = 0
        self._state: VehicleState | None = None
        self._estimate: Estimate | None = None
        self._trace: list[npt.NDArray[np.float64]] = []
        self._trace_start = 0

    def move(self, now: int, *, armed: bool) -> None:
        """Run all physics steps that end by ``now`` (µs, not decreasing).

        The reference is renewed on a fixed grid. Without a reference the motors stop, or idle if ``armed``.
        """
        vehicle, guidance, sensors = self.vehicle, self._guidance, self.sensors
        period, stride = self._period, self._stride
        if not armed:
            # A disarmed vehicle's motors never turn, whatever the guidance requests.
            guidance.idle()
        self._trace_start = self._steps
        self._trace.clear()
        last = now // period
        while self._steps < last:
            count = min(last - self._steps, stride - self._steps % stride)
            begin, step = self._steps * period, count * period
            exact = sensors.exact
            wind = self._air(begin)
            reference = self.course.next(step)
            if reference is not None and not exact:
                reference = self._shifted(reference)
            idle = armed and reference is None
            self._trace.append(vehicle.advance(count, reference, wind, idle=idle))
            guidance.advance(begin, step, self._local(wind), sensors.drift)
            self._steps += count
            self._state = self._estimate = None
            if not exact:
                self._sense()

    @property
    def time(self) -> int:
        """End time of the last physics step (µs)."""
        return self._steps * self._period

    @property
    def state(self) -> VehicleState:
        """True state after the last physics step; it is cached, so do not modify it."""
        if self._state is None:
            self._state = self.vehicle.state
        return self._state

    @property
    def wind(self) -> Vector:
        """Velocity of the air (m/s, site NED) in the last physics step."""
        return self.vehicle.air

    def estimate(self) -> Estimate:
        """Return the estimated state."""
        if self._estimate is None:
            self._estimate = self.sensors.estimate(self.state)
        return self._estimate

    @property
    def estimate_error(self) -> npt.NDArray[np.float64]:
        """Estimated minus true position (3,) (m, site NED)."""
        return _NOTHING if self.sensors.exact else self.sensors.deviation(self.state).position

    @property
    def trace(self) -> npt.NDArray[np.float64]:
        """Positions (n, 3) (m, site NED) after each physics step of the last ``move``."""
        if len(self._trace) == 1:
            return self._trace[0]
        return np.concatenate(self._trace) if self._trace else np.empty((0, 3))

    @property
    def trace_times(self) -> npt.NDArray[np.int64]:
        """Times (n,) of the positions in ``trace`` (µs)."""
        return np.arange(self._trace_start + 1, self._steps + 1, dtype=np.int64) * self._period

    # Events and faults, effective from the next stride on

    def begin(self, now: int) -> None:
        """Mark the goal event at ``now`` (µs)."""
        if self._weather is not None:
            self._weather.begin(now)

    def lose_gps(self) -> None:
        """Stop GPS."""
        self.sensors.lose_gps(self.time, self.state)

    def shift_gps(self, offset: Vector) -> None:
        """Set the error of GPS positions to ``offset`` (m, local NED); zero ends the fault."""
        self.sensors.shift_gps(offset, self.time, self.state)

    # Within a stride

    def _air(self, now: int) -> Vector:
        weather = self._weather
        if weather is None:
            return ZERO
        if not weather.turbulent:
            return weather.wind(now)
        u, v, w = self.state.velocity.tolist()
        return weather.wind(now, self._ground - float(self.state.position[2]), (u, v, w))

    def _local(self, wind: Vector) -> Vector:
        """Convert a velocity from site NED to the vehicle's local NED."""
        return wind if wind == ZERO else self._origin.vector_to_local(np.array(wind))

    def _shifted(self, reference: Reference) -> Reference:
        """Return ``reference`` shifted such that the vehicle flies as if controlled on its estimate."""
        off = self.sensors.deviation(self.state)
        if self.sensors.gps.located:
            return believed(reference, off)
        return self._level.unlocated(reference, off, self.state)

    def _sense(self) -> None:
        self.sensors.advance(self.time, self.state)
        if self.sensors.gps.resets != self._resets:
            self._resets = self.sensors.gps.resets
            estimate = self.estimate()
            self._guidance.relocate(estimate.position, estimate.velocity)
