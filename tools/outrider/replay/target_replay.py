"""Command ``outrider replay LOG --target ID``: a simulated own vehicle escorts the recorded target."""

from __future__ import annotations

import re
from pathlib import Path

from pydantic import ValidationError
from pymavlink.dialects.v20 import all as mavlink

from companion.config import CompanionConfig
from mavlink_bridge.messages import SetpointLocal
from mavlink_bridge.tlog.log import read_tlog
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.header import header
from outrider.errors import InputError
from outrider.resources import find
from outrider.scenarios.scenario import Origin, RecordedTarget, Ring, Scenario
from outrider.shadow.roles import OwnRecords
from outrider.simulation.preparation import Prepared
from outrider.yaml_files.yaml_file import load
from sitl.vehicle.config import VehicleConfig

_MARGIN_M = 20.0
"""Horizontal margin of the flight box beyond the target's positions (m)."""
_LONGEST_S = 3600.0


def prepared(log: Path, seen: OwnRecords, target: int, like: str) -> Prepared:
    """Return a flight of one vehicle around the recorded ``target``.

    It has the companion's settings of the scenario ``like``, except the task (escort) and the horizontal
    flight box (around the target's positions). It lasts as long as the log, an hour at most. ``seen`` is the
    survey of the target. Raises InputError for settings that cannot be flown.
    """
    base = load(find("scenarios", like), Scenario)
    limits, fleet = base.companion.limits, seen.fleet
    far = seen.reach + _MARGIN_M
    box = {"box_min": (-far, -far, limits.box_min[2]), "box_max": (far, far, limits.box_max[2])}
    companion = base.companion.model_dump() | {"task": "escort", "limits": limits.model_dump() | box}
    origin = Origin(latitude=fleet.latitude, longitude=fleet.longitude, altitude=fleet.altitude)
    height = min(max(limits.box_min[2] + 1.0, 4.0), limits.box_max[2])
    try:
        scenario = Scenario(
            name=f"chase-{re.sub('[^A-Za-z0-9._-]', '-', log.name.split('.')[0])}"[:64],
            task="escort",
            vehicles=1,
            vehicle=base.vehicle,
            flavour=base.flavour,
            origin=origin,
            starts=Ring(kind="ring", radius=4.0, height=height),
            target=RecordedTarget(
                kind="recorded",
                log=str(log.resolve()),
                system=target,
                start_s=0.0,
                duration_s=min(seen.seconds, _LONGEST_S),
            ),
            d_min_target=base.d_min_target,
            sensors=base.sensors,
            companion=CompanionConfig.model_validate(companion),
        )
    except ValidationError as error:
        said = "; ".join(one["msg"] for one in error.errors())
        raise InputError(f"{log}: cannot be flown like {like}: {said}") from None
    return Prepared(scenario, load(find("vehicles", scenario.vehicle), VehicleConfig))


def setpoints(log: Path) -> list[tuple[int, SetpointLocal]]:
    """Return all SET_POSITION_TARGET_LOCAL_NED of a log, with their times (µs)."""
    codec = Codec(
        lambda identifier, _system, _component: (
            identifier == mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED
        )
    )
    return [
        (record.time, message)
        for record in read_tlog(log)
        if header(record.frame).message_id == mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED
        for message in codec.feed(record.frame)
        if isinstance(message, SetpointLocal)
    ]
