"""``outrider fly`` on ``outrider sitl`` as processes, each vehicle with its own, a switch in between that
carries the swarm link and may cut it, and lives of trouble: a row of mishaps, each with what has to follow.

A life is a generator. It yields what it waits for, and goes on when that is so; so several are led at once,
and nothing depends on how fast the machine is.
"""

from __future__ import annotations

import json
import math
import os
import resource
import signal
import socket
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Generator
from pathlib import Path
from random import Random
from struct import pack
from typing import Any, Final

import numpy as np
from fly_process import FLEET, GUIDED, HELD, HOST
from test_sitl_command import free_base

from mavlink_bridge.clock import WallClock
from mavlink_bridge.codec import Codec
from mavlink_bridge.links.opening import open_link
from mavlink_bridge.messages import CommandLong, GlobalPosition, Heartbeat, Message, ParamSet, SetMode, Source
from outrider.beacon import Beacon
from outrider.paths import Motion

PATIENCE: Final = 300.0
"""s until a test gives up; what is waited for comes within seconds, on a machine that has nothing else to
do."""
GROUND: Final = Source(255, 190)
INJECT, GPS_UNIT, OFF, OK = 420, 4, 1, 0
LOST = "its process"
PACE: Final = 0.9
"""By its rate a clock is known for a simulation's, which stands now and then on a busy machine. At 1 it is
taken for a vehicle's, and what stood for slow: for a minute nothing of it is fresh."""
D_MIN = 0.5
_STEERED = ("escort", "hold", "return", "settle")
_TOUCH = 5.0
"""s after which whoever was alone is heard by all, hears all, and has made way."""

Wait = Callable[[], object]
Life = Generator[tuple[str, Wait], None, None]


def resident(process: int) -> int | None:
    """Bytes in memory; None where nobody tells."""
    try:
        pages = Path(f"/proc/{process}/statm").read_text()
    except (OSError, ValueError):
        return None
    return int(pages.split()[1]) * resource.getpagesize()


class Switch:
    """The swarm's links in one place: what a companion says goes to all others, and the target's words to
    all. ``cut``: systems that nothing passes to or from; ``silent``: whether the target is."""

    def __init__(self) -> None:
        self._ends: dict[int, socket.socket] = {}
        self._peers: dict[int, Any] = {}
        self._beacon = Beacon(100, "target", 5.0, FLEET)
        self._began = time.monotonic()
        self.cut: set[int] = set()
        self.silent = False
        self.noise: dict[int, Callable[[], bytes]] = {}

    def port(self, system: int) -> int:
        """Where the companion of ``system`` speaks to."""
        end = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        end.bind((HOST, 0))
        end.setblocking(False)
        self._ends[system] = end
        return int(end.getsockname()[1])

    def pump(self) -> None:
        """Carry on what has come; say what is due."""
        for system, end in self._ends.items():
            while True:
                try:
                    data, self._peers[system] = end.recvfrom(65536)
                except OSError:
                    break
                if system not in self.cut:
                    for other in self._ends.keys() - self.cut - {system}:
                        self._say(other, data)
        now = round(1e6 * (time.monotonic() - self._began))
        if self._beacon.due(now):
            angle = 0.1e-6 * now
            place = 6.0 * np.array([math.cos(angle), math.sin(angle), 0.0])
            velocity = 0.6 * np.array([-math.sin(angle), math.cos(angle), 0.0])
            for datagram in self._beacon.say(now, Motion(place, velocity)):
                for system in self._ends.keys() - self.cut if not self.silent else ():
                    self._say(system, datagram.data)
        for system, noise in self.noise.items():
            self._say(system, noise())

    def _say(self, system: int, data: bytes) -> None:
        if system in self._peers:
            try:
                self._ends[system].sendto(data, self._peers[system])
            except OSError:
                # Nobody listens at present.
                return

    def close(self) -> None:
        for end in self._ends.values():
            end.close()


class Bird:
    """A vehicle, its companion's process, and an ear at another of the vehicle's ports. ``steady``: its
    process is left alone, so that its memory can be looked at for long."""

    def __init__(self, system: int, flavour: str, switch: Switch, directory: Path, *, steady: bool) -> None:
        self.system, self.flavour, self.switch, self.steady = system, flavour, switch, steady
        self.directory = directory
        self._port = switch.port(system)
        self._base = free_base(flavour, 1)
        self._codec = Codec()
        self.summaries: list[dict[str, Any]] = []
        self.lives = 0
        self.provoked = 0
        self.mode: int | None = None
        self.beats = 0
        self.place: tuple[float, np.ndarray] | None = None
        self.memory: dict[int, list[tuple[float, int]]] = {}
        self.flights = 0
        self.alone_until = 0.0
        self.events: list[dict[str, Any]] = []
        self._read = 0
        self._sitl: subprocess.Popen[str] | None = None
        self._fly: subprocess.Popen[str] | None = None

    # Processes

    def power_up(self) -> None:
        """A vehicle with a full battery on its pad."""
        directory = self.directory / f"sitl-{self.system}"
        directory.mkdir(exist_ok=True)
        origin = FLEET.to_geodetic(np.array([12.0 * self.system - 24.0, -14.0, 0.0]))
        self._sitl = self._start(
            directory,
            "sitl",
            "--json",
            f"--flavour={self.flavour}",
            f"--first-id={self.system}",
            f"--port-base={self._base}",
            f"--speedup={PACE}",
            f"--origin={origin[0]:.7f},{origin[1]:.7f},{FLEET.altitude}",
        )
        other = self._base + (2 if self.flavour == "ardupilot" else 10)
        kind = "tcp" if self.flavour == "ardupilot" else "udpin"
        self._ear = open_link(f"{kind}:{HOST}:{other}", WallClock())
        self.mode, self.beats, self.place = None, 0, None

    def take_seat(self) -> None:
        """Start ``outrider fly``."""
        self.lives += 1
        kind = "tcp" if self.flavour == "ardupilot" else "udpin"
        home = self.directory / f"fly-{self.system}-{self.lives}"
        home.mkdir()
        self.run = home / "run"
        self._read, self.events = 0, []
        self._fly = self._start(
            home,
            "fly",
            "--json",
            f"--out={self.run}",
            f"--autopilot={kind}:{HOST}:{self._base}",
            f"--swarm=udpout:{HOST}:{self._port}",
            f"--config={self.directory / 'companion.yaml'}",
            f"--system={self.system}",
        )

    def _start(self, directory: Path, *options: str) -> subprocess.Popen[str]:
        name = f"{options[0]}-{time.monotonic_ns()}"
        with (directory / f"{name}.out").open("w") as out, (directory / f"{name}.err").open("w") as err:
            return subprocess.Popen(
                [sys.executable, "-m", "outrider", *options],
                stdin=subprocess.PIPE,
                stdout=out,
                stderr=err,
                text=True,
                start_new_session=True,
            )

    @property
    def parent(self) -> subprocess.Popen[str]:
        assert self._fly is not None
        return self._fly

    @property
    def broken(self) -> str:
        """What a process said that should not have ended, or not so."""
        if self._fly is None or self._fly.poll() in (None, 0):
            return ""
        return sorted(self.run.parent.glob("fly-*.err"))[-1].read_text()

    @property
    def pilot(self) -> int:
        """The process that flies."""
        last = [
            event["text"]
            for event in self.events
            if event["what"] == "process" and "in process" in event["text"]
        ]
        return int(last[-1].rpartition(" ")[2])

    def signal_sitl(self, which: signal.Signals) -> None:
        """To all its processes."""
        assert self._sitl is not None
        os.killpg(self._sitl.pid, which)

    def is_off(self) -> bool:
        """Whether the SITL has ended; then its ear is deaf."""
        assert self._sitl is not None
        if self._sitl.poll() is None:
            return False
        self._ear.close()
        return True

    def end(self) -> None:
        """Whatever still runs."""
        for process in (self._fly, self._sitl):
            if process is not None and process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
                process.communicate()
        self._ear.close()

    # What is seen and said

    def pump(self) -> None:
        """Hear the vehicle, read what its companion notes."""
        for data in self._ear.receive():
            for message in self._codec.feed(data, whole=True):
                if isinstance(message, Heartbeat) and message.autopilot != 8:
                    self.mode, self.beats = message.custom_mode, self.beats + 1
                elif isinstance(message, GlobalPosition):
                    place = FLEET.to_enu(message.latitude, message.longitude, message.altitude)
                    self.place = time.monotonic(), place
        path = self.run / "events.jsonl" if self._fly is not None else None
        if path is not None and path.exists():
            with path.open(encoding="utf-8") as file:
                file.seek(self._read)
                for line in iter(file.readline, ""):
                    if line.endswith("\n"):
                        self.events.append(json.loads(line))
                        self._read = file.tell()

    def say(self, message: Message) -> None:
        """As a ground station."""
        self._ear.send(self._codec.encode(message))

    def order(self, word: str) -> None:
        """As typed."""
        assert self.parent.stdin is not None
        self.parent.stdin.write(f"{word}\n")
        self.parent.stdin.flush()

    def sees(self, what: str, text: str, since: int) -> bool:
        """Whether there is such an event after the first ``since``."""
        return any(event["what"] == what and text in event["text"] for event in self.events[since:])

    def is_concerned(self, text: str) -> bool:
        """Whether that is a concern now."""
        told = [event for event in self.events if event["what"] in ("concern", "over", "process")]
        told = [event for event in told if text in event["text"] or event["what"] == "process"]
        return bool(told) and told[-1]["what"] == "concern"

    @property
    def life(self) -> tuple[int, int]:
        """Another one: another process flies, or none does, and knows nobody yet."""
        return self.lives, sum(event["what"] in ("process", "lost", "phase") for event in self.events)

    @property
    def phase(self) -> str:
        phases = [event["text"] for event in self.events if event["what"] in ("phase", "lost")]
        return phases[-1] if phases else ""

    @property
    def waiting(self) -> str:
        waits = [event["text"] for event in self.events if event["what"] == "waiting"]
        return waits[-1] if waits else ""

    def weigh(self, seconds: float) -> None:
        """Note the memory of both processes."""
        if self._fly is None or self.parent.poll() is not None or not self.events:
            return
        for process in (self.parent.pid, self.pilot):
            size = resident(process)
            if size is not None:
                self.memory.setdefault(process, []).append((seconds, size))


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
  voice: {texts: true}
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
