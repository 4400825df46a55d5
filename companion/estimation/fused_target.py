"""Target estimated from the detections of all cameras of a fleet.

A detection counts if it is finite, of plausible accuracy, of a vehicle of the fleet, of the target, and not
from the future; others are counted and dropped.
"""

from __future__ import annotations

from math import sqrt
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from pymavlink.dialects.v20 import all as mavlink

from companion.config import CompanionConfig
from companion.config.target_source import FusedSource
from companion.estimation.camera_weights import CameraWeights
from companion.estimation.detections import Detection, detection
from companion.estimation.fusion import Belief, Fusion
from companion.estimation.fusion_log import Counts, FusionLog, FusionTally
from companion.estimation.tracks import State
from companion.values.horizon import Array
from companion.values.mates import Sight
from mavlink_bridge.frames import FleetFrame, Point
from mavlink_bridge.messages import CameraFovStatus, CameraTrackingGeo, Source

_MAX_DISTANCE_M = 1e5
_SEEN_US = 500_000
"""Time (µs) in which a detection counts as seeing now."""


_NOTHING_ASKED = None, None


class Outgoing(NamedTuple):
    """Own detection to forward: time (µs) of the image, the camera's field of view, and the detection."""

    time: int
    view: CameraFovStatus
    message: CameraTrackingGeo


class FusedTarget:
    """Estimate of the target by the companion of ``system``; it is used as ``Target`` is."""

    def __init__(self, config: CompanionConfig, source: FusedSource, system: int, fleet: FleetFrame) -> None:
        self._config, self._source, self._system, self._fleet = config, source, system, fleet
        self._fusion = Fusion(source, config.target.rewind_us)
        self._weights = CameraWeights(config, system, source.latency_us)
        self._own = self._others = self._invalid = 0
        self._waiting: Outgoing | None = None
        self._next = 0
        self._sent = 0
        self._log = FusionLog()
        self._last: tuple[int | None, Belief | None] = _NOTHING_ASKED

    @property
    def counts(self) -> Counts:
        """Numbers of detections so far."""
        fusion = self._fusion
        numbers = self._own, self._others, self._sent, fusion.used, fusion.refused, fusion.late
        return Counts(*numbers, self._invalid)

    @property
    def tally(self) -> FusionTally:
        """Counters and log for the summary."""
        return self._log.tally(self.counts)

    def shed(self) -> None:
        """Empty the log."""
        self._log.clear()

    def record(self, now: int) -> None:
        """Add a row to the log if one is due at ``now`` (µs)."""
        if not self._log.due(now):
            return
        known = self._known(now)
        if known is not None:
            seen_by = len(self._fusion.recent(now - _SEEN_US - self._source.latency_us))
            self._log.add(now, known.position, known.covariance, seen_by)

    @property
    def refused(self) -> int:
        """Number of detections that were dropped, or refused by the gate."""
        return self._invalid + self._fusion.late + self._fusion.refused

    def drop(self) -> None:
        """Count a detection that cannot be used."""
        self._invalid += 1

    def heard(self, now: int, source: Source, stamp: int) -> None:
        """Receive that a position of a neighbour's companion arrived at ``now`` (µs) with ``stamp``."""
        self._weights.heard(now, source, stamp)

    def receive(
        self,
        now: int,
        time: int,
        camera: Point | None,
        view: CameraFovStatus | None,
        message: CameraTrackingGeo,
    ) -> bool:
        """Receive a detection of an image taken at ``time`` (µs) by a camera at ``camera`` (ENU, m).

        ``view``: of the same image. Return whether the detection counts.
        """
        found = self._detection(time, camera, message)
        if found is None:
            self._invalid += 1
            return False
        self._last = _NOTHING_ASKED
        if not self._fusion.put(found):
            return False
        self._weights.saw(message.source)
        if message.source.system != self._system:
            self._others += 1
            return True
        self._own += 1
        if self._source.share and view is not None:
            self._waiting = Outgoing(time, view, message)
        return True

    def outgoing(self, now: int) -> list[Outgoing]:
        """Return the own detections to forward at ``now`` (µs): the newest, if one is due."""
        if self._waiting is None or now < self._next:
            return []
        waiting, self._waiting = self._waiting, None
        period = self._config.rates.detection_us
        # A camera of the same period is not slowed down by jitter of its messages.
        self._next = max(self._next, now - period // 2) + period
        self._sent += 1
        return [waiting]

    def at(self, now: int) -> State | None:
        """Return the target's state at ``now`` (µs); None before the first detection and when stale."""
        return self.fresh(self.last(now))

    def last(self, now: int) -> State | None:
        """Return the last known state at ``now`` (µs), however old; None before the first detection."""
        known = self._known(now)
        if known is None:
            return None
        age, sigma = now - known.time, _worst_sigma(known.covariance)
        return State(known.position, known.velocity, age, sigma, known.turn_rate)

    def fresh(self, state: State | None) -> State | None:
        """Return ``state``, or None if it is older than ``guard.target_stale_us``."""
        old = state is not None and state.age > self._config.guard.target_stale_us
        return None if old else state

    def age(self, now: int) -> int | None:
        """Return the age (µs) of the last image that counts; None before the first."""
        time = self._fusion.time
        return None if time is None else now - time

    def covariance(self, now: int) -> Array | None:
        """Return the covariance (3, 3) of the target's position at ``now`` (µs); None before the first."""
        known = self._known(now)
        return None if known is None else known.covariance

    def sight(self, now: int, ahead: float) -> Sight:
        """Return what is known beside the state; the horizon ends ``ahead`` (s) after ``now`` (µs)."""
        weights = self._weights.measured(now, self._fusion)
        if not weights:
            return Sight()
        known = self._known(now + round(1e6 * ahead))
        prior = 0j
        if known is not None:
            (a, b, _), (_, d, _), _ = known.covariance.tolist()
            # −½(λ₁ − λ₂) e^{2iφ₁} of the information in the plane.
            prior = complex(0.5 * (a - d), b) / (a * d - b * b)
        return Sight(MappingProxyType(weights), prior)

    def _known(self, time: int) -> Belief | None:
        """Return what is known at ``time`` (µs); None before the first detection.

        In one step several parts ask for the same time.
        """
        asked, found = self._last
        if asked != time:
            found = self._fusion.at(time, self._config.target.extrapolate_us)
            self._last = time, found
        return found

    def _detection(self, time: int, camera: Point | None, message: CameraTrackingGeo) -> Detection | None:
        source = self._source
        system = message.source.system
        if camera is None or message.status != mavlink.CAMERA_TRACKING_STATUS_FLAGS_ACTIVE:
            return None
        if source.device is not None and message.device != source.device:
            return None
        if source.vehicles and system not in source.vehicles and system != self._system:
            return None
        place = self._fleet.to_east_north_up(message.latitude, message.longitude, message.altitude)
        east, north, up = place
        # NaN is not near either.
        if not east * east + north * north + up * up <= _MAX_DISTANCE_M**2:
            return None
        return detection(source, system, time, place, camera, message)


def _worst_sigma(P: Array) -> float:
    """Return σ along the worst axis of a covariance ``P`` (3, 3)."""
    return sqrt(max(float(np.linalg.eigvalsh(P)[-1]), 0.0))
