"""Extract of a recorded flight of several vehicles: the data that their responses are measured with.

    .venv/bin/python tools/benchmarks/extract_swarm.py FOLDER OUTPUT.npz

FOLDER holds `vehicle-N.tlog.gz`, the messages that each companion received and sent; `configuration-*.yaml`,
with the fleet's `origin`; and `truth.npz` with `T0` (s, wall clock) and rows `tN` (s, wall clock; east,
north, up, m; their velocities, m/s) of each vehicle's simulator.

Every set-point is kept. Every second estimate (LOCAL_POSITION_NED) and every row of the truth are kept, from
one second before the first set-point to one second after the last. All values are rounded to 1/4096 of their
unit; the truth is known to a centimetre.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Final

import numpy as np
import yaml
from pymavlink.dialects.v20 import all as mavlink

from benchmarks.recorded_swarms import FLAVOURS, Array, FlavourName, SwarmVehicle, write_swarm
from mavlink_bridge.errors import LogError
from mavlink_bridge.frames import FleetFrame, LocalFrame, enu_to_ned
from mavlink_bridge.messages import GpsGlobalOrigin, Heartbeat, LocalPosition, SetpointLocal, Source
from mavlink_bridge.tlog.log import read_tlog
from mavlink_bridge.wire.codec import Codec
from outrider.errors import InputError, OutriderError

_HEARD: Final = frozenset(
    (
        mavlink.MAVLINK_MSG_ID_HEARTBEAT,
        mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
        mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN,
        mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED,
    )
)
_EITHER_SIDE: Final = 50
"""Number of messages before and after each among which the least delayed one is searched."""
_EVERY: Final = 2
_MARGIN: Final = 1.0
"""Time (s) before the first and after the last set-point."""
_PARTS: Final = 4096.0


def measured_at(arrived: Array, boot: Array) -> Array:
    """Return the times (n,), s on the receiver's clock, at which messages were created.

    ``arrived`` (n,) are their times of arrival and ``boot`` (n,) the vehicle's time stamps, s. Some messages
    are hardly delayed, and none arrives before it is created.
    """
    offsets = arrived - boot
    count = len(offsets)
    least = [offsets[max(0, i - _EITHER_SIDE) : min(count, i + _EITHER_SIDE)].min() for i in range(count)]
    return np.asarray(boot + np.array(least))


def extracted(folder: Path) -> list[SwarmVehicle]:
    """Return the vehicles of a recorded flight. Raises LogError and InputError."""
    frame = _frame(folder)
    logs = sorted(folder.glob("vehicle-*.tlog.gz"))
    if not logs:
        raise InputError(f"{folder}: holds no vehicle-N.tlog.gz")
    try:
        with np.load(folder / "truth.npz") as file:
            begin = float(file["T0"])
            truths = {name[1:]: file[name] for name in file.files if name[0] == "t" and name[1:].isdecimal()}
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"{folder / 'truth.npz'}: {error}") from None
    vehicles = []
    for log in logs:
        number = log.name.removeprefix("vehicle-").removesuffix(".tlog.gz")
        if number not in truths:
            raise InputError(f"{folder / 'truth.npz'}: holds no t{number}")
        sys.stderr.write(f"{log}\n")
        vehicles.append(_vehicle(log, int(number), frame, begin, _truth(truths[number], begin)))
    return vehicles


def main() -> int:
    """Run the command line; return 2 if the flight cannot be read."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("output", type=Path)
    given = parser.parse_args()
    try:
        write_swarm(given.output, extracted(given.folder))
    except (LogError, OutriderError) as error:
        sys.stderr.write(f"{error}\n")
        return 2
    sys.stdout.write(f"{given.output}: {given.output.stat().st_size} bytes\n")
    return 0


def _frame(folder: Path) -> FleetFrame:
    found = sorted(folder.glob("configuration-*.yaml"))
    if not found:
        raise InputError(f"{folder}: holds no configuration-*.yaml")
    try:
        origin = yaml.safe_load(found[0].read_text(encoding="utf-8"))["origin"]
        return FleetFrame(origin["latitude"], origin["longitude"], origin["altitude"])
    except (OSError, yaml.YAMLError, KeyError, TypeError) as error:
        raise InputError(f"{found[0]}: no origin: {error}") from None


def _truth(rows: Array, begin: float) -> Array:
    """Convert to NED, with each time once."""
    _, first = np.unique(rows[:, 0], return_index=True)
    rows = rows[first]
    return np.column_stack((rows[:, 0] - begin, enu_to_ned(rows[:, 1:4]), enu_to_ned(rows[:, 4:7])))


def _vehicle(log: Path, system: int, frame: FleetFrame, begin: float, truth: Array) -> SwarmVehicle:
    own = Source(system, mavlink.MAV_COMP_ID_AUTOPILOT1)
    codec = Codec(lambda number, _system, _component: number in _HEARD)
    flavour: FlavourName | None = None
    local: LocalFrame | None = None
    sent: list[tuple[float, ...]] = []
    told: list[tuple[float, ...]] = []
    for record in read_tlog(log):
        time = record.time * 1e-6 - begin
        for message in codec.feed(record.frame):
            match message:
                case Heartbeat() if message.source == own:
                    flavour = FLAVOURS.get(message.autopilot)
                case GpsGlobalOrigin() if message.source == own:
                    local = frame.local(message.latitude, message.longitude, message.altitude)
                case LocalPosition() if message.source == own:
                    told.append(
                        (time, message.time_boot * 1e-6, *message.position_ned, *message.velocity_ned)
                    )
                case SetpointLocal() if message.source.system == system:
                    sent.append((time, *message.position, *message.velocity, *message.acceleration))
    if flavour is None or local is None or not told or not sent:
        raise InputError(f"{log}: no vehicle {system} that is sent set-points and tells where it is")
    setpoints, rows = np.array(sent), np.array(told)
    estimate = np.column_stack((measured_at(rows[:, 0], rows[:, 1]), rows[:, 2:]))
    first, last = setpoints[0, 0] - _MARGIN, setpoints[-1, 0] + _MARGIN
    kept = [part[(part[:, 0] >= first) & (part[:, 0] <= last)] for part in (estimate[::_EVERY], truth)]
    motions = _fleet(setpoints, local), _fleet(kept[0], local), kept[1]
    return SwarmVehicle(system, flavour, *(np.round(part * _PARTS) / _PARTS for part in motions))


def _fleet(rows: Array, local: LocalFrame) -> Array:
    """Convert rows of time, position and free vectors from a vehicle's own NED to that of the fleet."""
    parts = [rows[:, :1], enu_to_ned(local.position_to_fleet(rows[:, 1:4]))]
    parts += [enu_to_ned(local.velocity_to_fleet(rows[:, at : at + 3])) for at in range(4, rows.shape[1], 3)]
    return np.hstack(parts)


if __name__ == "__main__":
    sys.exit(main())
