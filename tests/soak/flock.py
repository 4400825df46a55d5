"""Some vehicles in trouble at once, in real time, around one target."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Final

from tests.soak.birds import Bird
from tests.soak.switch import Switch
from tests.soak.trouble import Trouble

PATIENCE: Final = 300.0
"""s until a test gives up; what is waited for comes within seconds, on a machine that has nothing else to
do."""
D_MIN = 0.5
_STEERED = ("escort", "hold", "return", "settle")
_TOUCH = 5.0
"""s after which whoever was alone is heard by all, hears all, and has made way."""


class Flock:
    """Some birds, led at once for ``seconds``; then each is called home. ``progress`` hears the seconds."""

    def __init__(
        self,
        directory: Path,
        flavours: tuple[str, ...],
        seed: int,
        seconds: float,
        progress: Callable[[float], None] = lambda _s: None,
    ) -> None:
        write_companion(directory)
        self.switch = Switch()
        self.birds = [
            Bird(1 + k, flavour, self.switch, directory, steady=k == 0) for k, flavour in enumerate(flavours)
        ]
        self._began = time.monotonic()
        self._seconds, self._progress = seconds, progress
        self.troubles = [
            Trouble(
                bird, [b for b in self.birds if b is not bird], Random(f"{seed} {bird.system}"), self._is_over
            )
            for bird in self.birds
        ]
        self._random = Random(f"{seed} target")
        self.least = math.inf
        self.silences = 0
        self._silence: tuple[float, float] = (10.0, 14.0)

    @property
    def seconds(self) -> float:
        return time.monotonic() - self._began

    def _is_over(self) -> bool:
        return self.seconds >= self._seconds

    def fly(self) -> None:
        """All of it; AssertionError for what did not follow."""
        lives = {trouble.bird.system: trouble.life() for trouble in self.troubles}
        waits = {system: (*next(life), self.seconds) for system, life in lives.items()}
        weighed = 0.0
        try:
            while lives:
                self.switch.pump()
                self._target()
                for bird in self.birds:
                    bird.pump()
                    assert not bird.broken, self._story(bird.system, f"a process that ended: {bird.broken}")
                self._touch()
                self._separation()
                for system in list(lives):
                    what, so, since = waits[system]
                    if so():
                        try:
                            waits[system] = (*lives[system].send(None), self.seconds)
                        except StopIteration:
                            del lives[system]
                    else:
                        assert self.seconds - since < PATIENCE, self._story(system, what)
                if self.seconds - weighed > 10.0:
                    weighed = self.seconds
                    self._progress(weighed)
                    for bird in self.birds:
                        bird.weigh(weighed)
                time.sleep(0.005)
        finally:
            for bird in self.birds:
                bird.end()
            self.switch.close()

    def _story(self, system: int, what: str) -> str:
        bird = next(bird for bird in self.birds if bird.system == system)
        lines = "\n".join(
            f"{event['wall_s']} {event['what']}: {event['text']}" for event in bird.events[-40:]
        )
        return f"vehicle {system} waits for {what} in mode {bird.mode}, {bird.phase}:\n{lines}"

    def _target(self) -> None:
        """Silent now and then."""
        begin, end = self._silence
        self.switch.silent = begin <= self.seconds < end
        if self.seconds >= end and not self._is_over():
            self.silences += 1
            begin = self.seconds + self._random.uniform(15.0, 40.0)
            self._silence = begin, begin + self._random.uniform(4.0, 8.0)

    def _touch(self) -> None:
        now = time.monotonic()
        for bird in self.birds:
            if bird.system in self.switch.cut or bird.phase not in _STEERED:
                bird.alone_until = now + _TOUCH

    def _separation(self) -> None:
        now = time.monotonic()
        flying = [bird for bird in self.birds if bird.place is not None and now - bird.place[0] < 0.5]
        for k, one in enumerate(flying):
            for other in flying[:k]:
                assert one.place is not None
                assert other.place is not None
                # Who was cut off, or has no companion, is where nobody heard that it would be.
                in_touch = now > max(one.alone_until, other.alone_until)
                if in_touch and min(one.place[1][2], other.place[1][2]) > 1.0:
                    apart = math.dist(one.place[1], other.place[1])
                    self.least = min(self.least, apart)
                    assert apart >= D_MIN, (one.system, other.system, apart)


def write_companion(directory: Path) -> None:
    """The file of all: low batteries come within minutes, and the SITL's estimates are exact."""
    (directory / "companion.yaml").write_text(
        """
system: 1
target: 100
origin: {latitude: 47.397742, longitude: 8.545594, altitude: 488.0}
takeoff_height: 5.0
companion:
  surface: {radius: 5.0, height: 5.0}
  limits: {v_max: [4.0, 4.0, 2.0], box_min: [-100.0, -100.0, 2.5], box_max: [100.0, 100.0, 30.0]}
  field: {d_min: 0.95, d_safe: 3.0}
  guard: {fence_radius: 100.0, fence_height: 40.0, battery_low: 0.7, battery_critical: 0.6}
  rates: {replan_us: 100000, setpoint_us: 40000}
  ground_messages: {texts: true}
period_us: 20000
"""
    )


def check_summaries(birds: list[Bird]) -> None:
    """What every companion that ended says of itself."""
    for bird in birds:
        for summary in bird.summaries:
            assert not summary["fault"], summary
            assert summary.get("not_finite", 0) == 0
            faults = [fault for fault in summary.get("setpoint_faults", []) if "jump" not in fault]
            assert faults == [], summary
        assert sum(len(summary["restarts"]) for summary in bird.summaries) == bird.provoked
