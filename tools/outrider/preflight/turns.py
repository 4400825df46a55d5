"""Turns of the flights alone: vehicles fly one after another, by their ids, while all others are disarmed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

from mavlink_bridge.wire.preflight import Stage, Turn
from outrider.preflight.lone_flight import LoneFlight
from outrider.preflight.tube import LEAST_S, TrackingError

_SILENT_US: Final = 2_000_000
"""Time (µs) since the last message of a vehicle after which its stage is not known."""
_LOST_US: Final = 5_000_000
"""The same while the own vehicle flies: then it lands."""
PERIOD_US: Final = 200_000
"""Time between two messages of the own stage, µs."""


class _Heard(NamedTuple):
    time: int
    turn: Turn


class Turns:
    """Turn of ``system`` among ``others``; ``make`` returns its flight, None in a dry run.

    ``wait`` (µs): longest time to wait for others that are not heard. ``asks``: whether only the operator's
    go is missing; ``go``: set it to True for the go. ``trouble``: why there is no result, empty otherwise.
    """

    def __init__(
        self,
        system: int,
        others: Sequence[int],
        fingerprint: int,
        make: Callable[[], LoneFlight] | None,
        wait: int,
        *,
        go: bool,
    ) -> None:
        self._system, self._others, self._fingerprint = system, tuple(others), fingerprint
        self._make, self._wait, self.go = make, wait, go
        self._go_given = go
        self.flight: LoneFlight | None = None
        self.stage = Stage.CHECKS
        self.asks = False
        self.trouble = ""
        self.doing = ""
        self._heard: dict[int, _Heard] = {}
        self._waited_from: int | None = None

    def receive(self, now: int, system: int, turn: Turn) -> None:
        """Receive the stage of another vehicle at ``now`` (µs)."""
        if system in self._others and turn.fingerprint == self._fingerprint:
            self._heard[system] = _Heard(now, turn)

    @property
    def result(self) -> TrackingError | None:
        """Tracking error of the flight; None without one that counts."""
        return None if (flight := self._landed) is None else flight.result

    @property
    def drift(self) -> float | None:
        """Drift (m) of the flight in take-off and landing; None without one that counts."""
        return None if (flight := self._landed) is None else flight.drift

    @property
    def _landed(self) -> LoneFlight | None:
        return self.flight if self.stage is Stage.LANDED else None

    def end(self, why: str) -> None:
        """Do not fly, because of ``why``, which is empty if a check on the ground says it."""
        if self.stage is not Stage.LANDED:
            self.stage, self.trouble = Stage.ENDED, self.trouble or why

    def stop(self, now: int, why: str) -> None:
        """Land, or do not fly, because of ``why``."""
        if self.stage is Stage.FLIES and self.flight is not None:
            self.flight.stop(now, why)
        else:
            self.end(why)

    def step(self, now: int, inbox: Sequence[bytes], *, disarmed: bool) -> list[bytes]:
        """Return what is to be sent to the autopilot at ``now`` (µs); ``inbox``: what has arrived of it.

        Call it once the checks on the ground have passed. ``disarmed``: whether the own vehicle is.
        """
        if self.stage is Stage.CHECKS:
            self.stage = Stage.READY
            if self._make is None:
                self.end("a dry run does not fly")
        if self.stage is Stage.READY:
            self._await(now, disarmed=disarmed)
        if self.stage is not Stage.FLIES or self.flight is None:
            return []
        if trouble := self._in_the_way(now, _LOST_US):
            self.flight.stop(now, trouble)
        sent = self.flight.step(now, inbox)
        self.doing = self.flight.doing
        if self.flight.over:
            trouble = self.flight.trouble
            if not trouble and self.flight.result.seconds < LEAST_S:
                trouble = f"only {self.flight.result.seconds:.0f} s were flown by set-points"
            self.stage = Stage.ENDED if trouble else Stage.LANDED
            self.trouble = trouble
        return sent

    def _await(self, now: int, *, disarmed: bool) -> None:
        """Begin the flight when all lower ids have flown, all are disarmed, and the operator says go."""
        self.asks = False
        if ended := [one for one in self._others if self._stage(one) is Stage.ENDED]:
            self.end(f"vehicle {ended[0]} does not fly, its own screen says why")
            return
        if trouble := self._in_the_way(now, _SILENT_US):
            self._waited_from = now if self._waited_from is None else self._waited_from
            if now - self._waited_from > self._wait:
                self.end(trouble)
            self.doing = f"waiting: {trouble}"
            # A go counts only while nothing else is missing.
            self.go = self._go_given
            return
        self._waited_from = None
        before = [one for one in self._others if one < self._system]
        early = [one for one in self._others if self._stage(one) is Stage.CHECKS]
        waits = early or [one for one in before if self._stage(one) is not Stage.LANDED]
        if waits:
            self.doing, self.go = f"waiting for the flight of vehicle {min(waits)}", self._go_given
        elif not disarmed:
            self.doing, self.go = "waiting until the own vehicle is disarmed", self._go_given
        elif not self.go:
            self.asks, self.doing = True, "waiting for the operator's go: type go, and the vehicle takes off"
        elif self._make is not None:
            self.flight, self.stage = self._make(), Stage.FLIES

    def _stage(self, system: int) -> Stage | None:
        heard = self._heard.get(system)
        return None if heard is None else heard.turn.stage

    def _in_the_way(self, now: int, silent: int) -> str:
        """Return why the own vehicle may not be in the air, or an empty string."""
        for system in self._others:
            heard = self._heard.get(system)
            if heard is None or now - heard.time > silent:
                return f"vehicle {system} is not heard; it needs preflight --fly, too"
            of_lower = system < self._system and self.stage is Stage.READY
            flies = heard.turn.stage is Stage.FLIES
            if not heard.turn.disarmed and not (flies and of_lower):
                return f"vehicle {system} is not disarmed"
        return ""

    def message(self, run: int, *, disarmed: bool) -> Turn:
        """Return the message of the own stage."""
        return Turn(run, self._fingerprint, self.stage, disarmed)

    def over(self, now: int) -> bool:
        """Return whether the own vehicle does not fly any more, and no other one will at ``now`` (µs)."""
        if self.stage is Stage.ENDED:
            return not any(self._stage(one) is Stage.FLIES and self._fresh(one, now) for one in self._others)
        if self.stage is not Stage.LANDED:
            return False
        if any(self._stage(one) is Stage.ENDED for one in self._others):
            return not any(self._stage(one) is Stage.FLIES and self._fresh(one, now) for one in self._others)
        silent = [one for one in self._others if not self._fresh(one, now)]
        if silent:
            self._waited_from = now if self._waited_from is None else self._waited_from
            if now - self._waited_from > self._wait:
                return True
        else:
            self._waited_from = None
        self.doing = "waiting for the flights of the others"
        return all(self._stage(one) is Stage.LANDED for one in self._others)

    def _fresh(self, system: int, now: int) -> bool:
        heard = self._heard.get(system)
        return heard is not None and now - heard.time <= _SILENT_US
