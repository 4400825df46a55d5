"""The life of a vehicle in trouble: a row of mishaps in real time, each with what has to follow.

A life is a generator. It yields what it waits for, and goes on when that is so; so several are led at once,
and nothing depends on how fast the machine is.
"""

from __future__ import annotations

import json
import os
import signal
import time
from collections import Counter
from collections.abc import Callable, Generator
from random import Random
from struct import pack
from typing import Final

from mavlink_bridge.messages import CommandLong, ParamSet, SetMode, Source
from tests.outrider.onboard.process import GUIDED, HELD
from tests.soak.birds import Bird

GROUND: Final = Source(255, 190)
INJECT, GPS_UNIT, OFF, OK = 420, 4, 1, 0

BATTERY_LOW: Final = 0.7
"""Share at which the companion comes home, as flock's file says."""
_SPARE: Final = 0.05
"""Share that half a minute of flight takes, and some."""

Wait = Callable[[], object]
Life = Generator[tuple[str, Wait], None, None]


class Trouble:
    """Leads the life of one bird. ``begun`` counts mishaps. ``over``: whether it is time to come home."""

    def __init__(self, bird: Bird, others: list[Bird], random: Random, over: Wait) -> None:
        self.bird, self.others, self._random, self._over = bird, others, random, over
        self.begun: Counter[str] = Counter()

    def life(self) -> Life:
        """From power-up to the end."""
        bird = self.bird
        bird.power_up()
        yield from self._is("a heartbeat of the SITL", lambda: bird.beats > 0)
        yield from self._fly()
        mishaps = {
            "told to hold": self._hold,
            "taken over": self._taken,
            "swarm link cut": self._cut,
            "autopilot stands still": self._pause,
            "noise": self._noise,
        }
        if bird.flavour == "px4":
            mishaps["GPS lost"] = self._gps
        if not bird.steady:
            mishaps |= {
                "companion killed": self._kill,
                "companion hangs": self._freeze,
                "stopped by SIGTERM": self._terminate,
                "told to land": self._land,
                "told to return": self._return,
            }
        names: list[str] = []
        while not (self._over() and self.begun):
            if not names:
                # All of them, again and again, each time in another order.
                names = self._random.sample(list(mishaps), len(mishaps))
            if self._is_due_home():
                yield "the end of its battery", lambda: self.bird.phase != "escort"
                yield from self._escorts()
                continue
            name = names.pop()
            self.begun[name] += 1
            yield from mishaps[name]()
            yield from self._escorts()
            yield from self._pause_of(self._random.uniform(1.0, 5.0))
        yield from self._stop(signal.SIGINT)

    # Waiting

    def _is(self, what: str, so: Wait) -> Life:
        yield what, so

    def _sees(self, what: str, text: str, since: int) -> Life:
        bird = self.bird
        yield f"{what} {text!r}", lambda: bird.sees(what, text, since)

    def _pause_of(self, seconds: float) -> Life:
        until = time.monotonic() + seconds
        yield "time", lambda: time.monotonic() >= until

    def _mode(self, table: dict[str, int]) -> Life:
        bird = self.bird
        yield f"mode {table[bird.flavour]}", lambda: bird.mode == table[bird.flavour]

    def _fly(self) -> Life:
        """A new companion on a vehicle, wherever that is."""
        self.bird.flights += 1
        self.bird.take_seat()
        yield from self._up()

    def _up(self) -> Life:
        bird = self.bird
        yield "waiting for a go", lambda: bird.waiting == "the operator's go"
        yield from self._pause_of(0.5)
        bird.order("go")
        yield from self._escorts()

    def _escorts(self) -> Life:
        """In the air and ours; what its battery or its autopilot has ended is begun anew."""
        bird = self.bird

        def settled() -> bool:
            return bird.phase == "escort" or bird.parent.poll() is not None or self._asks()

        while True:
            yield "the escort", settled
            if bird.parent.poll() is not None:
                yield from self._ended("landed")
                bird.signal_sitl(signal.SIGTERM)
                yield "the end of the SITL", bird.is_off
                bird.power_up()
                yield "a heartbeat of the SITL", lambda: bird.beats > 0
                bird.flights += 1
                bird.take_seat()
                yield "a first event", lambda: bool(bird.events)
            elif bird.phase != "escort":
                bird.order("go")
                yield from self._pause_of(2.0)
            else:
                return

    def _is_due_home(self) -> bool:
        """Whether its battery will call it home before a mishap is over: then that would wait in vain."""
        battery = self.bird.battery
        return battery is not None and battery < BATTERY_LOW + _SPARE

    def _asks(self) -> bool:
        bird = self.bird
        return bird.phase in ("connect", "yielded") and (
            bird.waiting == "the operator's go" or bird.phase == "yielded"
        )

    def _ended(self, why: str) -> Life:
        bird = self.bird
        yield f"the end: {why}", lambda: bird.parent.poll() is not None
        out = sorted(bird.run.parent.glob("fly-*.out"))[-1].read_text()
        err = sorted(bird.run.parent.glob("fly-*.err"))[-1].read_text()
        assert bird.parent.returncode == 0, (bird.system, out, err)
        assert "Traceback" not in err, err
        summary = json.loads(out)
        assert why in summary["ended"], summary
        bird.summaries.append(summary)

    # Mishaps

    def _hold(self) -> Life:
        since = len(self.bird.events)
        self.bird.order("hold")
        yield from self._sees("phase", "hold", since)
        yield from self._pause_of(2.0)
        self.bird.order("go")
        yield from self._sees("phase", "escort", since)

    def _return(self) -> Life:
        """It lands at home, and its companion ends."""
        since = len(self.bird.events)
        self.bird.order("return")
        yield from self._sees("phase", "return", since)
        yield from self._sees("phase", "done", since)

    def _land(self) -> Life:
        since = len(self.bird.events)
        self.bird.order("land")
        yield from self._sees("phase", "settle", since)
        yield from self._sees("phase", "done", since)

    def _taken(self) -> Life:
        """By a ground station; nothing is asked back."""
        bird, since = self.bird, len(self.bird.events)
        bird.say(SetMode(GROUND, HELD[bird.flavour], bird.system, 1))
        yield from self._sees("concern", "Vehicle taken over", since)
        yield from self._sees("phase", "yielded", since)
        yield from self._pause_of(3.0)
        assert bird.mode == HELD[bird.flavour]
        bird.order("go")
        yield from self._sees("phase", "escort", since)
        yield from self._mode(GUIDED)

    def _cut(self) -> Life:
        bird, now = self.bird, time.monotonic()
        deaf = {other.system: other.life for other in self.others if other.alone_until < now}
        bird.switch.cut.add(bird.system)
        yield "Target lost", lambda: bird.is_concerned("Target lost")
        words = f"Neighbour {bird.system} is not heard"
        yield (
            f"others say {words}",
            lambda: all(
                other.is_concerned(words) or other.life != deaf[other.system]
                for other in self.others
                if other.system in deaf
            ),
        )
        bird.switch.cut.discard(bird.system)
        yield "Target is back", lambda: not bird.is_concerned("Target lost")

    def _pause(self) -> Life:
        """It brakes while nothing is heard, and flies on when the simulation does."""
        bird, since = self.bird, len(self.bird.events)
        bird.signal_sitl(signal.SIGSTOP)
        yield from self._pause_of(self._random.uniform(1.0, 3.0))
        bird.signal_sitl(signal.SIGCONT)
        yield from self._sees("concern", "Own position is old", since)
        yield "a position that is new", lambda: not bird.is_concerned("Own position is old")
        assert not bird.sees("lost", "", since), bird.events[since:]

    def _noise(self) -> Life:
        """Broken frames by the swarm link are nobody's words."""
        bird, since, random = self.bird, len(self.bird.events), self._random
        bird.switch.noise[bird.system] = lambda: pack("<B", 0xFD) + random.randbytes(random.randrange(1, 600))
        yield from self._pause_of(3.0)
        bird.switch.noise.pop(bird.system)
        assert not bird.sees("lost", "", since)

    def _gps(self) -> Life:
        """Lost for long: the autopilot lands by itself, and that is left to it."""
        bird, since = self.bird, len(self.bird.events)
        bird.say(ParamSet(GROUND, pack("<i", 1), bird.system, 1, "SYS_FAILURE_EN", 6))
        yield from self._pause_of(0.5)
        bird.say(CommandLong(GROUND, bird.system, 1, INJECT, 0, (GPS_UNIT, OFF, 0.0, 0.0, 0.0, 0.0, 0.0)))
        long = self._random.random() < 0.5
        if long:
            yield from self._sees("phase", "yielded", since)
        else:
            yield from self._pause_of(2.0)
        bird.say(CommandLong(GROUND, bird.system, 1, INJECT, 0, (GPS_UNIT, OK, 0.0, 0.0, 0.0, 0.0, 0.0)))
        yield from self._pause_of(1.0)

    def _kill(self) -> Life:
        os.kill(self.bird.pilot, signal.SIGKILL)
        yield from self._is_followed()

    def _freeze(self) -> Life:
        os.kill(self.bird.pilot, signal.SIGSTOP)
        yield from self._is_followed()

    def _is_followed(self) -> Life:
        """Its vehicle holds, and another companion waits for a go."""
        bird, since = self.bird, len(self.bird.events)
        bird.provoked += 1
        yield from self._sees("lost", "the companion is gone", since)
        # One that was silent for long has been left by PX4 for its HOLD already.
        yield from self._sees("last word", "the vehicle: ", since)
        yield from self._mode(HELD)
        yield from self._sees("waiting", "the operator's go", since)
        assert bird.mode == HELD[bird.flavour]
        yield from self._up()

    def _terminate(self) -> Life:
        yield from self._stop(signal.SIGTERM)
        yield from self._mode(HELD)
        yield from self._fly()

    def _stop(self, which: signal.Signals) -> Life:
        self.bird.parent.send_signal(which)
        yield from self._ended(which.name)
        assert self.bird.summaries[-1]["last_word"].startswith(("holds", "not armed", "not ours"))
