"""Track of the target, fed by the configured kind of message, from one sender at a time."""

from __future__ import annotations

import numpy as np
from pymavlink.dialects.v20 import all as mavlink

from companion.config import CompanionConfig
from companion.config.target_source import CameraSource, FixedSource, message_of, sender_of
from companion.estimation.tracks import State, Track, measured
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import (
    BY_ID,
    CameraTrackingGeo,
    FollowTarget,
    GlobalPosition,
    Message,
    Source,
)
from mavlink_bridge.messages.source import Vector


class Target:
    """Receives messages about the target and estimates its state, fleet-local ENU.

    ``refused`` counts messages of the right kind that were ignored: from senders other than the accepted one,
    or from a camera that does not track.
    """

    def __init__(self, config: CompanionConfig, system: int, target_system: int, fleet: FleetFrame) -> None:
        source = config.target_source
        self._config = config
        self._fleet = fleet
        self._system = system
        number = message_of(source)
        self._kind = None if number is None else BY_ID[number].message
        self._accepted_system = sender_of(source, system, target_system)
        self._links = ("target", "autopilot") if isinstance(source, CameraSource) else ("target",)
        self._fixed = None
        if isinstance(source, FixedSource):
            self._fixed = State(np.array(source.at), np.zeros(3), 0, 0.0)
        self._track = self._before = Track(config.target)
        self._sender: Source | None = None
        self._received = 0
        self.refused = 0

    def receive(self, now: int, link: str, message: Message) -> bool:
        """Receive a message from ``link`` at ``now`` (µs); return whether it became part of the track."""
        if self._kind is None or not isinstance(message, self._kind) or link not in self._links:
            return False
        if not self._accepts(now, message.source):
            self.refused += 1
            return False
        if not self._measure(now, message):
            return False
        self._received = now
        return True

    def at(self, now: int) -> State | None:
        """Return the target's state at ``now`` (µs); None before the first measurement and when stale."""
        return self.fresh(self.last(now))

    def last(self, now: int) -> State | None:
        """Return the last known state at ``now`` (µs), however old: extrapolated for a bounded time.

        A target that falls silent may still be there. Returns None before the first measurement.
        """
        return self._known_track.at(now) if self._fixed is None else self._fixed

    def fresh(self, state: State | None) -> State | None:
        """Return ``state``, or None if it is older than ``guard.target_stale_us``."""
        old = state is not None and state.age > self._config.guard.target_stale_us
        return None if old else state

    def age(self, now: int) -> int | None:
        """Return the age (µs) of the last measurement: None before the first, 0 for a fixed target."""
        if self._fixed is not None:
            return 0
        time = self._known_track.time
        return None if time is None else now - time

    @property
    def _known_track(self) -> Track:
        """Track of the current sender, or of the previous one until the current one's has a state."""
        return self._before if self._track.time is None else self._track

    def _accepts(self, now: int, source: Source) -> bool:
        """Return whether messages of ``source`` are accepted at ``now`` (µs).

        Two components of one system may both report a target, each with its own clock and errors. The source
        received first is kept until none of its messages has entered the track for ``guard.target_stale_us``.
        """
        if source.system == 0 or (
            self._accepted_system is not None and source.system != self._accepted_system
        ):
            return False
        if self._accepted_system is None and source.system == self._system:
            return False
        if source == self._sender:
            return True
        if self._sender is not None:
            if now - self._received <= self._config.guard.target_stale_us:
                return False
            # The new sender has another clock and other errors.
            self._before, self._track = self._known_track, Track(self._config.target)
        self._sender, self._received = source, now
        return True

    def _measure(self, now: int, message: Message) -> bool:
        """Add the measurement in ``message`` to the track; return whether it was accepted."""
        velocity: Vector | None
        if isinstance(message, GlobalPosition):
            velocity, stamp = message.velocity_ned, message.time_boot
        elif isinstance(message, FollowTarget):
            # In FOLLOW_TARGET three zeros also stand for an unknown velocity.
            velocity = message.velocity if message.velocity is not None and any(message.velocity) else None
            stamp = message.time_boot
        elif (
            isinstance(message, CameraTrackingGeo)
            and message.status == mavlink.CAMERA_TRACKING_STATUS_FLAGS_ACTIVE
        ):
            velocity, stamp = message.velocity_ned, 0
        else:
            self.refused += 1
            return False
        place = self._fleet.to_east_north_up(message.latitude, message.longitude, message.altitude)
        speed = None if velocity is None else (velocity[1], velocity[0], -velocity[2])
        return self._track.take(now, measured(place, speed, upward=self._config.target.velocity_up), stamp)
