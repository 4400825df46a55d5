"""The emulated autopilot as a node: datagrams in, datagrams out, physics in between."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from mavlink_bridge.codec import Codec
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import Message, Source, Vector
from mavlink_bridge.node import Datagram
from sitl import sensors
from sitl.autopilot_config import AutopilotConfig
from sitl.commander import Commander
from sitl.config import VehicleConfig
from sitl.flavours import ARMED, Flavour, Mode
from sitl.flavours.ardupilot import ArduPilot
from sitl.flavours.px4 import Px4
from sitl.guidance import Activity, Guidance
from sitl.orders import Orders
from sitl.origin import Origin
from sitl.reception import Reception
from sitl.setpoints import ZERO
from sitl.steering import Steering
from sitl.telemetry import IN_AIR, LANDING, ON_GROUND, ORIGIN, TAKING_OFF, Snapshot, Telemetry
from sitl.vehicle import Reference, Vehicle, VehicleState
from sitl.voice import Voice

LINK: Final = "autopilot"
"""The one link of the node."""

# MAV_COMP_ID_AUTOPILOT1
_COMPONENT: Final = 1
# PING, COMMAND_INT, COMMAND_LONG, SET_POSITION_TARGET_LOCAL_NED, TIMESYNC
_HEARD: Final = frozenset((4, 75, 76, 84, 111))
# The reference is renewed at least this often (µs); the vehicle extrapolates it in between.
_RENEWAL: Final = 5_000

_FLAVOURS: Final[dict[str, type[ArduPilot] | type[Px4]]] = {"ardupilot": ArduPilot, "px4": Px4}
# In the air; with thrust cut it is about to be on the ground.
_LANDED_STATES: Final = {Activity.TAKEOFF: TAKING_OFF, Activity.LAND: LANDING, Activity.IDLE: LANDING}


class Autopilot:
    """One vehicle with its autopilot, as a ``Node`` with the link ``autopilot``.

    The physics moves in the NED frame of ``site``; what is sent and received is in the vehicle's own local
    NED. The truth of the last step is there for who composes a simulation: ``trace``, ``trace_times``,
    ``state``, ``reference``.
    """

    def __init__(self, config: AutopilotConfig, vehicle: VehicleConfig, site: FleetFrame, seed: int) -> None:
        """On the ground at the configured place, which becomes the origin of its local frame; ``seed`` for
        noise."""
        self.config = config
        self.wind: Vector = ZERO
        """Velocity of the air (m/s, site NED), for whoever makes weather."""
        self._source = Source(config.system_id, _COMPONENT)
        self._origin = Origin(site, config.latitude, config.longitude, config.altitude)
        self._period = vehicle.physics_period
        self._stride = max(1, _RENEWAL // self._period)
        ground = float(self._origin.position[2]) + vehicle.rest_height
        self._vehicle = Vehicle(vehicle, self._origin.position, config.yaw + self._origin.turn, ground)
        self._sensors = sensors.sensors(config.sensors, self._origin, seed)
        self._flavour: Flavour = _FLAVOURS[config.flavour](config)
        self._telemetry = Telemetry(config.rates, self._flavour.reports_ekf)
        self._guidance = Guidance(config)
        self._outbox: list[Message] = []
        voice = Voice(self._source, self._outbox)
        steering = Steering(self._flavour, self._guidance, voice)
        self._commander = Commander(
            config, self._flavour, self._guidance, steering, self._estimate, self._origin.altitude, voice
        )
        orders = Orders(self._commander, self._flavour, self._telemetry)
        self._reception = Reception(self._source, self._outbox, voice, self._commander, orders, steering)
        self._codec = Codec(accept=lambda message_id, _system, _component: message_id in _HEARD)
        self._boot: int | None = None
        self._now = 0
        self._steps = 0
        self._followed: Reference | None = None
        self._elapsed = 0
        self._trace: list[npt.NDArray[np.float64]] = []
        self._trace_start = 0

    @property
    def name(self) -> str:
        """Unique as the system id is."""
        return f"sitl-{self.config.system_id}"

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        """Move to ``now``, then act on what arrived, then tell what is due: at most one datagram.

        What arrives at ``now`` steers from ``now`` on. The first call is the boot.
        """
        if self._boot is None:
            self._boot = now
            self._telemetry.start(0)
        self._now = now - self._boot
        self._move()
        self._watch()
        for datagram in inbox:
            self._listen(datagram)
        return self._tell()

    def _move(self) -> None:
        """All physics steps that end by now, under a reference that is renewed on a fixed grid."""
        vehicle, guidance, period, stride = self._vehicle, self._guidance, self._period, self._stride
        self._trace_start = self._steps
        self._trace.clear()
        last = self._now // period
        while self._steps < last:
            count = min(last - self._steps, stride - self._steps % stride)
            reference = self.reference
            if reference is not None and self._followed is not None:
                reference = reference.following(self._followed, self._elapsed)
            self._followed, self._elapsed = reference, count * period
            self._trace.append(
                vehicle.advance(count, reference, self.wind, idle=reference is None and self._commander.armed)
            )
            guidance.advance(self._steps * period, count * period)
            self._steps += count

    def _watch(self) -> None:
        was_ready = self._commander.ready
        self._commander.watch(self._now, self._vehicle.on_ground)
        if self._commander.ready and not was_ready:
            self._telemetry.request(ORIGIN)

    def _listen(self, datagram: Datagram) -> None:
        if datagram.link != LINK:
            return
        for message in self._codec.feed(datagram.data):
            self._reception.handle(message, self._now, self._estimate())

    def _tell(self) -> list[Datagram]:
        messages = self._outbox
        if self._now >= self._telemetry.next_due:
            messages = messages + self._telemetry.collect(self._now, self._snapshot())
        if not messages:
            return []
        data = b"".join(map(self._codec.encode, messages))
        self._outbox.clear()
        return [Datagram(LINK, data)]

    def _estimate(self) -> sensors.Estimate:
        return self._sensors.estimate(self._now, self._vehicle.state)

    def _snapshot(self) -> Snapshot:
        commander, guidance, flavour = self._commander, self._guidance, self._flavour
        return Snapshot(
            self._source,
            self._now,
            self._estimate(),
            self._origin,
            commander.ready,
            commander.armed,
            len(self._vehicle.config.rotors),
            flavour.autopilot,
            flavour.base_mode(commander.mode) | (ARMED if commander.armed else 0),
            flavour.custom_mode(commander.mode),
            ON_GROUND if commander.landed else _LANDED_STATES.get(guidance.activity, IN_AIR),
            guidance.wanted(self._now) if guidance.activity is Activity.TRACK else None,
            flavour.echoes_yaw,
        )

    # The truth

    @property
    def trace(self) -> npt.NDArray[np.float64]:
        """Positions (n, 3) (m, site NED) after each physics step of the last ``step``."""
        return np.concatenate(self._trace) if self._trace else np.empty((0, 3))

    @property
    def trace_times(self) -> npt.NDArray[np.int64]:
        """When (n,) the vehicle was there (µs, on the clock of ``step``)."""
        steps = np.arange(self._trace_start + 1, self._steps + 1, dtype=np.int64)
        return steps * self._period + (self._boot or 0)

    @property
    def state(self) -> VehicleState:
        """The true state, site NED."""
        return self._vehicle.state

    @property
    def armed(self) -> bool:
        """Whether the motors may turn."""
        return self._commander.armed

    @property
    def airborne(self) -> bool:
        """Off the ground; after a touchdown until it counts as landed."""
        return not self._commander.landed

    @property
    def mode(self) -> Mode:
        """The flight mode."""
        return self._commander.mode

    @property
    def reference(self) -> Reference | None:
        """What is tracked now (site NED); None when nothing is."""
        guidance = self._guidance
        if guidance.activity is Activity.IDLE:
            return None
        motion = self._origin.motion_to_site((guidance.position, guidance.velocity, guidance.acceleration))
        return Reference(
            motion[0],
            motion[1],
            motion[2],
            yaw=guidance.yaw + self._origin.turn,
            yaw_rate=guidance.yaw_rate,
        )
