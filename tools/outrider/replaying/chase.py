"""``outrider replay LOG --target ID``: a simulated vehicle of ours escorts what the log recorded."""

from __future__ import annotations

from pathlib import Path

from mavlink_bridge.codec import Codec
from mavlink_bridge.messages import SetpointLocal
from mavlink_bridge.tlog import read_tlog
from outrider import names, swarm
from outrider.flight import Progress
from outrider.replaying.casting import SETPOINT, header, survey
from outrider.resources import find
from outrider.scenario import FIRST_SYSTEM, Origin, RecordedTarget, Ring, Scenario
from outrider.yaml_file import load
from sitl.config import VehicleConfig

_ROOM = 200.0
"""m around the first place that is flown in."""


def chase(
    log: Path, target: int, like: str, directory: Path, progress: Progress
) -> list[tuple[int, SetpointLocal]]:
    """Fly one vehicle with the companion's settings of the scenario ``like`` around ``target``, from the
    first word of where it is to the last; the set-points that it was sent, with their times (µs). The run is
    left in ``directory``. InputError as ``survey``."""
    seen = survey(read_tlog(log), target, str(log))
    base = load(find("scenarios", like), Scenario)
    limits = base.companion.limits
    # Wherever the target goes; nothing but its height is kept in bounds.
    box = {"box_min": (-_ROOM, -_ROOM, limits.box_min[2]), "box_max": (_ROOM, _ROOM, limits.box_max[2])}
    fleet = seen.fleet
    document = base.model_dump() | {
        "name": f"chase-{log.name.split('.')[0]}"[:64],
        "task": "escort",
        "vehicles": 1,
        "bystanders": (),
        "obstacles": (),
        "moving": (),
        "faults": (),
        "origin": Origin(
            latitude=fleet.latitude, longitude=fleet.longitude, altitude=fleet.altitude
        ).model_dump(),
        "starts": Ring(kind="ring", radius=4.0, height=max(limits.box_min[2] + 1.0, 4.0)).model_dump(),
        "target": RecordedTarget(
            kind="recorded", log=str(log.resolve()), system=target, start_s=0.0, duration_s=seen.seconds
        ).model_dump(),
        "companion": base.companion.model_dump() | {"limits": limits.model_dump() | box},
    }
    scenario = Scenario.model_validate(document)
    vehicle = load(find("vehicles", scenario.vehicle), VehicleConfig)
    swarm.fly(swarm.Prepared(scenario, vehicle), 1, directory, progress)
    return setpoints(directory / names.log(FIRST_SYSTEM))


def setpoints(log: Path) -> list[tuple[int, SetpointLocal]]:
    """All SET_POSITION_TARGET_LOCAL_NED of a log, with their times (µs)."""
    codec = Codec(lambda identifier, _system, _component: identifier == SETPOINT)
    return [
        (record.time, message)
        for record in read_tlog(log)
        if header(record.frame).message_id == SETPOINT
        for message in codec.feed(record.frame)
        if isinstance(message, SetpointLocal)
    ]
