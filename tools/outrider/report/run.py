"""What a run left, as far as it could be read: values only."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mavlink_bridge.messages import CommandAck, Heartbeat, StatusText
from mavlink_bridge.tlog.log import TlogReport
from outrider.scenarios.scenario import Scenario

Array = NDArray[np.float64]
Times = NDArray[np.int64]
Numbers = NDArray[np.uint8]
Said = Heartbeat | CommandAck | StatusText


class Gap(NamedTuple):
    """A part of the run that is missing or damaged: which, and why."""

    what: str
    why: str


class Motions(NamedTuple):
    """``flight.npz``: T samples of K vehicles and M moving obstacles; fleet-local ENU, SI, radians; NaN where
    there is nothing.

    ``system`` (K,); ``time`` (T,) s after the goal event, rising; ``position``, ``velocity``, ``reference``
    (T, K, 3); ``yaw``, ``tilt`` (T, K); ``target`` (T, 3); ``separation`` (T,): least since the sample
    before; ``moving`` (T, M, 3).
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
    """``plans.npz``: of n plans ``system`` (n,), ``time`` (n,) s after the goal event and ``size`` (n,) of ∇J
    divided by Ω_t, m."""

    system: NDArray[np.int64]
    time: Array
    size: Array


class PlanTimes(NamedTuple):
    """``plan_times.npz``: of n plans ``system`` (n,) and the CPU time ``spent`` (n,), ms."""

    system: NDArray[np.int64]
    spent: Array


class Sender(NamedTuple):
    """Who counts messages: a system and its component."""

    system: int
    component: int


class Stream(NamedTuple):
    """Messages of one sender on the swarm link, in the order in which a log has them.

    ``time`` (n,) µs on the clock of the log; ``sequence`` (n,) 0…255; ``mark`` (n,): equal for equal bytes.
    """

    time: Times
    sequence: Numbers
    mark: Times


class Utterance(NamedTuple):
    """A message worth a line, at ``time`` µs on the clock of the log."""

    time: int
    said: Said


class Log(NamedTuple):
    """One vehicle's tlog. ``begin``, ``end``: its first and last record, µs on its own clock.

    ``told``: what the vehicle itself said on the swarm link; ``heard``: what arrived there, empty where that
    has been compared already. ``speeds``: at
    ``moments`` (n,) µs the velocity (n, 3) that its autopilot told, ENU, m/s.
    """

    owner: int
    begin: int
    end: int
    told: Stream
    heard: dict[Sender, Stream]
    moments: Times
    speeds: Array
    utterances: tuple[Utterance, ...]
    report: TlogReport


class Run(NamedTuple):
    """All of it. ``summary`` is empty, and parts are None, where they are among the ``gaps``.
    ``configuration`` is the file's text."""

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
        """What was flown."""
        if self.scenario is not None:
            return self.scenario.name
        return str(self.summary.get("scenario") or self.directory.resolve().name)
