"""Target as a node: it sends GLOBAL_POSITION_INT on its link; the simulation knows its true position."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.errors import LogError
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import GlobalPosition
from mavlink_bridge.node import Datagram
from mavlink_bridge.tlog.log import read_tlog
from mavlink_bridge.wire.codec import Codec
from outrider.errors import InputError
from outrider.scenarios.part import TARGET_SYSTEM
from outrider.scenarios.places import FixedTarget, PathTarget, RecordedTarget
from outrider.simulation.beacon import Beacon
from outrider.simulation.paths import ClosedPath, Motion, Walk

Array = NDArray[np.float64]
LINK = "target"
SHORT = 1.0
"""s; a log may end this much before the end of the requested piece."""


class Placed(Protocol):
    """Object with a known true position."""

    def begin(self, now: int) -> None:
        """Process the goal event at ``now`` (µs): jump, or start along the path or the record."""
        ...

    def position(self, now: int) -> Array | None:
        """Return the true position (3,), fleet-local ENU, at ``now`` (µs); None when it is absent."""
        ...


class Target(Placed, Protocol):
    """Node with a known true position."""

    @property
    def name(self) -> str:
        """Name of the node."""
        ...

    @property
    def system(self) -> int:
        """System id in its messages."""
        ...

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        """Step as a ``Node``."""
        ...

    def move(self, now: int, place: Array) -> None:
        """Move the target to ``place`` (3,) at ``now``; it continues from there."""
        ...


class StandingTarget:
    """Target at one place; it jumps to others at the goal event and later, if configured."""

    name = "target"
    system = TARGET_SYSTEM

    def __init__(self, config: FixedTarget, fleet: FleetFrame) -> None:
        self._config = config
        self._place = np.array(config.at)
        self._jumps: deque[tuple[int, Array]] = deque()
        self._beacon = Beacon(TARGET_SYSTEM, LINK, config.rate_hz, fleet)

    def begin(self, now: int) -> None:
        """Make the configured jump at ``now`` (µs), with a message at once, and schedule the later ones."""
        config = self._config
        self._jumps.extend((now + round(1e6 * jump.after_s), np.array(jump.to)) for jump in config.jumps)
        if config.jump_to is not None:
            self._jump(now, np.array(config.jump_to))

    def position(self, now: int) -> Array | None:
        """Return the present place."""
        self._move(now)
        return self._place

    def move(self, now: int, place: Array) -> None:
        """Stand at ``place`` (3,) from ``now`` (µs) until the next scheduled jump."""
        self._move(now)
        self._jump(now, np.array(place))

    def _move(self, now: int) -> None:
        while self._jumps and self._jumps[0][0] <= now:
            self._jump(*self._jumps.popleft())

    def _jump(self, when: int, place: Array) -> None:
        self._place = place
        self._beacon.hasten(when)

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        """Send the position at the configured rate."""
        self._move(now)
        if not self._beacon.due(now):
            return []
        return self._beacon.say(now, Motion(self._place, np.zeros(3)))


class Walking:
    """Target on a closed path from the goal event on; until then it stands at the path's beginning."""

    name = "target"
    system = TARGET_SYSTEM

    def __init__(self, config: PathTarget, fleet: FleetFrame) -> None:
        paces = [(pace.after_s, pace.speed) for pace in config.paces]
        path = ClosedPath(np.array(config.through))
        self._walk = Walk(path, config.speed, config.setting_out, paces)
        self._aside: Array | None = None
        self._beacon = Beacon(TARGET_SYSTEM, LINK, config.rate_hz, fleet)

    def begin(self, now: int) -> None:
        """Start along the path."""
        self._walk.begin(now)

    def motion(self, now: int) -> Motion:
        """Return the true position and velocity at ``now`` (µs)."""
        motion = self._walk.motion(now)
        if self._aside is None:
            return motion
        return motion._replace(position=motion.position + self._aside)

    def position(self, now: int) -> Array | None:
        """Return the true position at ``now`` (µs)."""
        return self.motion(now).position

    def move(self, now: int, place: Array) -> None:
        """Shift the whole path so that the target is at ``place`` (3,) at ``now`` (µs)."""
        self._aside = (0.0 if self._aside is None else self._aside) + place - self.motion(now).position
        self._beacon.hasten(now)

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        """Send position and velocity at the configured rate."""
        if not self._beacon.due(now):
            return []
        return self._beacon.say(now, self.motion(now))


class Recording(NamedTuple):
    """Frames of one sender.

    ``times`` (n,): µs since the first of these frames. ``frames``: their bytes. ``positions`` (n, 3): the
    positions in them, fleet-local ENU (m).
    """

    times: NDArray[np.int64]
    frames: tuple[bytes, ...]
    positions: Array


class Recorded:
    """Target that replays a piece of a tlog; its true position is interpolated between those of the log."""

    name = "target"

    def __init__(self, config: RecordedTarget, path: Path, fleet: FleetFrame) -> None:
        self.system = config.system
        self.recording = load(config, path, fleet)
        self._fleet = fleet
        self._start: int | None = None
        self._next = 0
        self._aside: Array | None = None
        self._codec = Codec()

    def begin(self, now: int) -> None:
        """Start the record at ``now``."""
        self._start = now

    def position(self, now: int) -> Array | None:
        """Return the log's position interpolated at ``now``.

        Before the start it is the first position of the piece; after the end of the piece it is None.
        """
        times, places = self.recording.times, self.recording.positions
        since = 0 if self._start is None else now - self._start
        if since > times[-1]:
            return None
        there = np.array([np.interp(since, times, places[:, i]) for i in range(3)])
        return there if self._aside is None else there + self._aside

    def move(self, now: int, place: Array) -> None:
        """Shift the rest of the record to ``place``; its frames then differ from the recorded bytes."""
        here = self.position(now)
        if here is not None:
            self._aside = (0.0 if self._aside is None else self._aside) + place - here

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        """Send every frame that is due; its bytes are unchanged unless the target was moved."""
        out: list[Datagram] = []
        if self._start is None:
            return out
        times, frames = self.recording.times, self.recording.frames
        while self._next < len(frames) and times[self._next] <= now - self._start:
            out.append(Datagram(LINK, self._told(frames[self._next])))
            self._next += 1
        return out

    def _told(self, frame: bytes) -> bytes:
        """Return the frame; if the target was moved, encoded anew with the shifted position."""
        if self._aside is None:
            return frame
        out = b""
        for message in self._codec.feed(frame, whole=True):
            if isinstance(message, GlobalPosition):
                there = self._fleet.to_enu(message.latitude, message.longitude, message.altitude)
                latitude, longitude, altitude = self._fleet.to_geodetic(there + self._aside)
                message = message._replace(latitude=latitude, longitude=longitude, altitude=altitude)
            out += self._codec.encode(message)
        return out


def load(config: RecordedTarget, path: Path, fleet: FleetFrame) -> Recording:
    """Return the piece of the log that ``config`` selects, in the order of time.

    Raises InputError if the log cannot be read, if it ends more than ``SHORT`` before the end of the piece,
    or if the piece holds fewer than two GLOBAL_POSITION_INT of the system.
    """
    wanted = mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, config.system
    codec = Codec(lambda identifier, system, _component: (identifier, system) == wanted)
    first: int | None = None
    last = 0
    times: list[int] = []
    frames: list[bytes] = []
    positions: list[Array] = []
    try:
        log = read_tlog(path)
    except LogError as error:
        raise InputError(str(error)) from None
    for record in log:
        first = record.time if first is None else first
        last = max(last, record.time - first)
        since = record.time - first - round(config.start_s * 1e6)
        if since < 0 or since > config.duration_s * 1e6:
            continue
        for message in codec.feed(record.frame):
            if isinstance(message, GlobalPosition):
                times.append(since)
                frames.append(record.frame)
                positions.append(fleet.to_enu(message.latitude, message.longitude, message.altitude))
    end = config.start_s + config.duration_s
    if last < (end - SHORT) * 1e6:
        raise InputError(f"{path}: ends after {last * 1e-6:.1f} s; it is needed up to {end} s")
    if len(times) < 2:
        raise InputError(
            f"{path}: holds {len(times)} GLOBAL_POSITION_INT of system {config.system} between "
            f"{config.start_s} s and {end} s; at least 2 are needed"
        )
    # Stamps of real logs step back at times.
    order = np.argsort(times, kind="stable")
    return Recording(
        np.array(times)[order] - min(times), tuple(frames[i] for i in order), np.array(positions)[order]
    )
