"""What may go wrong in the air, of the guard's list (docs/guard.md): how it begins and ends, and the sentence
that the companion has to say of it in time."""

from __future__ import annotations

import math
from collections.abc import Callable
from random import Random
from typing import Any, NamedTuple

import numpy as np

from companion.errors import SolverError
from mavlink_bridge.messages import (
    BY_TYPE,
    Attitude,
    GpsGlobalOrigin,
    Heartbeat,
    LocalPosition,
    Message,
    PositionTarget,
    SetMode,
    SetpointLocal,
    SysStatus,
    SystemTime,
)
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.framing import frame_v2, leading_frames
from tests.companion.bench import field_of
from tests.soak.air_nodes import FENCE, GROUND, Edit
from tests.soak.airfield import Airfield, Craft

_MODES = {"ardupilot": {"hold": 17, "land": 9, "return": 6}, "px4": {"hold": 4 << 16 | 3 << 24}}
_MODES["px4"] |= {"land": 4 << 16 | 6 << 24, "return": 4 << 16 | 5 << 24}
GUIDED = {"ardupilot": 4, "px4": 6 << 16}
_STAMPED = LocalPosition | Attitude | SystemTime | PositionTarget
_BEFORE = 50_000_000


class Scene(NamedTuple):
    """Where a mishap happens, to whom, by which draws; ``name`` keeps its edits apart from others'."""

    field: Airfield
    craft: Craft
    random: Random
    name: str


class Mishap(NamedTuple):
    """``lasts`` s, from … to. ``sentence``: what the companion says of it, ``within`` so many s, empty for
    nothing. ``whole``: whether it strikes all vehicles, and is not begun again while it lasts."""

    name: str
    lasts: tuple[float, float]
    begin: Callable[[Scene], None]
    end: Callable[[Scene], None] = lambda _scene: None
    sentence: str = ""
    within: float = 0.0
    whole: bool = False


def _outward(edit: Callable[[Scene], Edit]) -> Callable[[Scene], None]:
    def begin(scene: Scene) -> None:
        scene.craft.radio.outward[scene.name] = edit(scene)

    return begin


def _clear(scene: Scene) -> None:
    scene.craft.radio.outward.pop(scene.name, None)
    scene.craft.radio.inward.pop(scene.name, None)


def _drop(*kinds: type[Message]) -> Callable[[Scene], Edit]:
    return lambda _scene: lambda message: () if isinstance(message, kinds) else (message,)


def _not_numbers(scene: Scene) -> Edit:
    """What no codec of ours would say."""
    values, codec = (math.nan, math.inf, -math.inf, 3e38), Codec()

    def edit(message: Message) -> tuple[Message | bytes, ...]:
        if not isinstance(message, LocalPosition | Attitude):
            return (message,)
        row = BY_TYPE[type(message)]
        (frame,), _ = leading_frames(codec.encode(message))
        fields = list(row.struct.unpack(frame.payload.ljust(row.struct.size, b"\0")))
        for place in scene.random.sample(range(1, len(fields)), 2):
            fields[place] = scene.random.choice(values)
        return (frame_v2(row.id, row.crc_extra, message.source, frame.data[4], row.struct.pack(*fields)),)

    return edit


def _battery(left: float) -> Callable[[Scene], Edit]:
    return lambda _scene: (
        lambda message: (
            (message._replace(battery_remaining=left) if isinstance(message, SysStatus) else message),
        )
    )


def _failing(_scene: Scene) -> Edit:
    return lambda message: (
        (message._replace(system_status=5) if isinstance(message, Heartbeat) else message),
    )


def _other_clock(scene: Scene) -> Edit:
    """It is this much later, or earlier, by its clock from now on, until it is booted."""
    by = scene.random.choice((-1, 1)) * scene.random.randint(20, 45) * 1_000_000

    def edit(message: Message) -> tuple[Message, ...]:
        if isinstance(message, _STAMPED):
            return (message._replace(time_boot=message.time_boot + _BEFORE + by),)
        return (message,)

    return edit


def _move_origin(scene: Scene) -> None:
    """The zero of its local frame is elsewhere from now on; it flies on as if nothing had been."""
    d = np.array([scene.random.uniform(-8, 8), scene.random.uniform(-8, 8), scene.random.uniform(-1, 1)])
    fleet = scene.field.target._beacon._fleet

    def shifted(vector: Any, sign: int) -> tuple[float, float, float]:
        x, y, z = (np.array(vector) + sign * d).tolist()
        return x, y, z

    def outward(message: Message) -> tuple[Message, ...]:
        if isinstance(message, GpsGlobalOrigin):
            here = fleet.to_enu(message.latitude, message.longitude, message.altitude)
            latitude, longitude, altitude = fleet.to_geodetic(here + np.array([d[1], d[0], -d[2]]))
            return (message._replace(latitude=latitude, longitude=longitude, altitude=altitude),)
        if isinstance(message, LocalPosition):
            return (message._replace(position_ned=shifted(message.position_ned, -1)),)
        return (message,)

    def inward(message: Message) -> tuple[Message, ...]:
        if isinstance(message, SetpointLocal):
            return (message._replace(position=shifted(message.position, 1)),)
        return (message,)

    scene.craft.radio.outward[scene.name] = outward
    scene.craft.radio.inward[scene.name] = inward
    _tell_origin(scene)


def _move_back(scene: Scene) -> None:
    _clear(scene)
    _tell_origin(scene)


def _tell_origin(scene: Scene) -> None:
    """As autopilots do when it has moved."""
    scene.craft.autopilot._communication.telemetry.request(49)


def _take_over(scene: Scene) -> None:
    mode = scene.random.choice(("hold", "hold", "land", "return"))
    scene.craft.marks["taken"] = mode
    _switch(scene, _MODES[scene.craft.flavour][mode])


def _give_back(scene: Scene) -> None:
    """By the switch, or by a new go, as PX4 wants set-points before it lets them steer."""
    craft = scene.craft
    if craft.marks.pop("taken", "") != "hold" or not craft.autopilot.airborne:
        return
    if craft.flavour == "ardupilot" and scene.random.random() < 0.5:
        _switch(scene, GUIDED[craft.flavour])
    else:
        scene.field.tower.go(craft.system)


def _switch(scene: Scene, mode: int) -> None:
    scene.craft.radio.said.append(SetMode(GROUND, mode, scene.craft.system, 1))


def _no_plans(scene: Scene) -> None:
    def fails(*_arguments: object) -> None:
        raise SolverError("as asked", 0)

    field_of(scene.craft.companion).planner.plan = fails  # type: ignore[assignment, method-assign]


def _plans_again(scene: Scene) -> None:
    vars(field_of(scene.craft.companion).planner).pop("plan", None)


def _hang(scene: Scene) -> None:
    scene.field.loop.freeze(scene.craft.slot.name)


def _go_on(scene: Scene) -> None:
    scene.field.loop.thaw(scene.craft.slot.name)


def _start_anew(scene: Scene) -> None:
    _go_on(scene)
    scene.craft.slot.start()


def _cut(channel: str) -> Callable[[Scene], None]:
    return lambda scene: scene.field.network.cut(channel.format(scene.craft.system), [scene.craft.slot.name])


def _heal(channel: str) -> Callable[[Scene], None]:
    return lambda scene: scene.field.network.heal(channel.format(scene.craft.system), [scene.craft.slot.name])


def _silence(scene: Scene) -> None:
    scene.field.target.silent = True


def _speak(scene: Scene) -> None:
    scene.field.target.silent = False


def _lead_out(scene: Scene) -> None:
    """Beyond the fence, between two pads."""
    angle = 2.0 * math.pi * scene.random.randrange(3) / 3.0 + 0.3 + math.pi / 3.0
    far = FENCE + 10.0
    scene.field.target.aside = np.array([far * math.cos(angle), far * math.sin(angle), 0.0])
    scene.field.target.speed = 3.0


def _lead_back(scene: Scene) -> None:
    scene.field.target.aside = None


def _leap(scene: Scene) -> None:
    angle = scene.random.uniform(0.0, 2.0 * math.pi)
    scene.field.target.leap(
        scene.random.uniform(3.0, 7.0) * np.array([math.cos(angle), math.sin(angle), 0.0])
    )


def _lose_gps(scene: Scene) -> None:
    scene.craft.autopilot.lose_gps()


def _regain_gps(scene: Scene) -> None:
    scene.craft.autopilot.regain_gps()


def _shift_gps(scene: Scene) -> None:
    angle, far = scene.random.uniform(0.0, 2.0 * math.pi), scene.random.uniform(1.0, 2.0)
    scene.craft.autopilot.shift_gps((far * math.cos(angle), far * math.sin(angle), 0.0))


def _unshift_gps(scene: Scene) -> None:
    scene.craft.autopilot.shift_gps((0.0, 0.0, 0.0))


def _order(command: int) -> Callable[[Scene], None]:
    return lambda scene: scene.field.tower.order(scene.craft.system, command)


def _go(scene: Scene) -> None:
    scene.field.tower.go(scene.craft.system)


OLD, LOST, UNHEARD = "Own position is old", "Own position is lost", "Autopilot is not heard"
NO_PLAN, CLOCK, LATE = "No plan can be found", "The autopilot's clock has jumped", "Deadlines are missed"
MISHAPS = (
    Mishap("own state old", (1.0, 4.0), _outward(_drop(LocalPosition)), _clear, OLD, 0.7),
    Mishap("own state lost", (6.0, 9.0), _outward(_drop(LocalPosition)), _clear, LOST, 5.3),
    Mishap("own state not a number", (1.0, 3.0), _outward(_not_numbers), _clear, OLD, 0.8),
    Mishap("target silent", (5.0, 12.0), _silence, _speak, "Target lost", 3.4, True),
    Mishap("target leaps", (0.1, 0.2), _leap, whole=True),
    Mishap("target beyond the fence", (18.0, 22.0), _lead_out, _lead_back, whole=True),
    Mishap("swarm link cut", (4.5, 10.0), _cut("swarm"), _heal("swarm"), "Neighbour", 4.2),
    Mishap(
        "autopilot link cut", (1.0, 8.0), _cut("autopilot-{}"), _heal("autopilot-{}"), "Own position", 0.7
    ),
    Mishap("no plan", (1.0, 3.0), _no_plans, _plans_again, NO_PLAN, 0.9),
    Mishap("no plan for long", (6.0, 8.0), _no_plans, _plans_again, f"{NO_PLAN}: landing", 5.5),
    Mishap("battery low", (600.0, 600.0), _outward(_battery(0.15)), _clear, "Battery", 1.3),
    Mishap("battery critical", (600.0, 600.0), _outward(_battery(0.05)), _clear, "Battery", 1.3),
    Mishap("heartbeats lost", (4.5, 8.0), _outward(_drop(Heartbeat)), _clear, UNHEARD, 4.2),
    Mishap("failsafe told", (2.0, 5.0), _outward(_failing), _clear, "Autopilot reports a failsafe", 1.3),
    Mishap("taken over", (6.0, 15.0), _take_over, _give_back, "Vehicle taken over", 1.3),
    Mishap("deadlines missed", (0.2, 0.8), _hang, _go_on, LATE, 1.0),
    Mishap("hangs", (1.0, 6.0), _hang, _go_on),
    Mishap("companion starts anew", (0.5, 4.0), _hang, _start_anew),
    Mishap("clock jumps", (600.0, 600.0), _outward(_other_clock), _clear, CLOCK, 3.5),
    Mishap("origin moves", (600.0, 600.0), _move_origin, _move_back),
    Mishap("GPS shifted", (3.0, 8.0), _shift_gps, _unshift_gps),
    Mishap("GPS lost", (2.0, 15.0), _lose_gps, _regain_gps),
    Mishap("told to hold", (5.0, 10.0), _order(17), _go),
    Mishap("told to return", (3.0, 60.0), _order(20), _go),
    Mishap("told to land", (1.0, 2.0), _order(21)),
)
