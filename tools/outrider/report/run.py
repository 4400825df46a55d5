"""Data of a run as far as it could be read: values only."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mavlink_bridge.messages import CameraFovStatus, CameraTrackingGeo, CommandAck, Heartbeat, StatusText
from mavlink_bridge.tlog.log import TlogReport
from outrider.scenarios.scenario import Scenario

Array = NDArray[np.float64]
Times = NDArray[np.int64]
Numbers = NDArray[np.uint8]
Said = Heartbeat | CommandAck | StatusText


class Gap(NamedTuple):
    """Part of the run that is missing or damaged, and the reason."""

    what: str
    why: str


class Motions(NamedTuple):
    """Content of ``flight.npz``: T samples of K vehicles and M moving obstacles.

    Coordinates are fleet-local ENU, units SI and radians; missing values are NaN. ``system`` (K,); ``time``
    (T,) s after the goal event, rising; ``position``, ``velocity``, ``reference`` (the position that the
    autopilot tracks) (T, K, 3); ``yaw``, ``tilt`` (T, K); ``target`` (T, 3); ``separation`` (T,): least
    distance between two vehicles in the air since the sample before, infinite without such a pair; ``moving``
    (T, M, 3): positions of the moving obstacles.
    """

    system: tuple[int, ...]
    time: Array
    position: Array
    velocity: Array
    reference: Array
    yaw: Array
    tilt: Array
    target: Array
    separation: Array
    moving: Array


class Plans(NamedTuple):
    """Content of ``plans.npz``: n plans.

    ``system`` (n,); ``time`` (n,) s after the goal event; ``size`` (n,): norm of ∇J divided by Ω_t, m (see
    ``flight_file.write_plans``).
    """

    system: NDArray[np.int64]
    time: Array
    size: Array


class PlanTimes(NamedTuple):
    """Content of ``plan_times.npz``: of n plans ``system`` (n,) and the CPU time ``spent`` (n,), ms."""

    system: NDArray[np.int64]
    spent: Array


class Sender(NamedTuple):
    """Source of numbered messages: a system and its component."""

    system: int
    component: int


class Stream(NamedTuple):
    """Messages of one sender on the swarm link, in the order of a log.

    ``time`` (n,) µs on the clock of the log; ``sequence`` (n,) 0…255; ``mark`` (n,): equal for equal bytes.
    """

    time: Times
    sequence: Numbers
    mark: Times


class EventMessage(NamedTuple):
    """Message that may become an event, at ``time`` µs on the clock of the log."""

    time: int
    said: Said


class CameraMessage(NamedTuple):
    """Message of the vehicle's camera, at ``time`` µs on the clock of the log."""

    time: int
    said: CameraFovStatus | CameraTrackingGeo


class Log(NamedTuple):
    """Data of one vehicle's tlog.

    ``begin``, ``end``: first and last record, µs on the vehicle's own clock. ``sent``: messages that the
    vehicle sent on the swarm link; ``received``: messages that it received there, empty if they have already
    been compared. ``speeds`` (n, 3): velocity reported by the autopilot at ``moments`` (n,) µs, ENU, m/s.
    ``seen``: what its camera said.
    """

    owner: int
    begin: int
    end: int
    sent: Stream
    received: dict[Sender, Stream]
    moments: Times
    speeds: Array
    utterances: tuple[EventMessage, ...]
    report: TlogReport
    seen: tuple[CameraMessage, ...] = ()


class Run(NamedTuple):
    """All data of a run.

    ``configuration`` is the text of the file. A part among the ``gaps`` that could not be read is None; for
    the summary and the configuration it is empty, and a log is not in ``logs``.
    """

    directory: Path
    summary: dict[str, object]
    configuration: str
    seed: int | None
    scenario: Scenario | None
    motions: Motions | None
    plans: Plans | None
    plan_times: PlanTimes | None
    logs: tuple[Log, ...]
    gaps: tuple[Gap, ...]

    @property
    def name(self) -> str:
        """Name of the scenario, or of the directory if the scenario is not known."""
        if self.scenario is not None:
            return self.scenario.name
        return str(self.summary.get("scenario") or self.directory.resolve().name)
