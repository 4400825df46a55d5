"""Flights at MAVProxy's prompt."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

from tests.clients.mavproxy_console import PATIENCE, MavProxy

HEIGHT: Final = 5.0
GOAL: Final = (47.397790, 8.545640, 7.0)
"""Latitude, longitude (degrees), height above home (m)."""
PLAN: Final = (
    "QGC WPL 110\n"
    "0\t1\t0\t16\t0\t0\t0\t0\t47.3977420\t8.5455940\t488.0\t1\n"
    "1\t0\t3\t22\t0\t0\t0\t0\t0.0\t0.0\t5.0\t1\n"
    "2\t0\t3\t16\t0\t0\t0\t0\t47.3978000\t8.5456000\t5.0\t1\n"
)
_FIELD: Final = re.compile(r"(\w+) : (-?[\d.]+(?:e[-+]?\d+)?)")

State = dict[str, float]
Place = tuple[float, float, float]


def state(proxy: MavProxy, kind: str = "LOCAL_POSITION_NED") -> State:
    """The fields of the newest message of a kind that MAVProxy has.

    Before it has requested streams, some 15 s after its start, it has none and shows nothing.
    """
    until = time.monotonic() + PATIENCE
    while True:
        try:
            shown = proxy.ask(f"status {kind}", rf"{kind} \{{(.*)\}}", 2.0).group(1)
        except AssertionError:
            if time.monotonic() > until:
                raise
            continue
        return {name: float(value) for name, value in _FIELD.findall(shown)}


def when(proxy: MavProxy, is_it: Callable[[State], bool], kind: str = "LOCAL_POSITION_NED") -> State:
    """As soon as the vehicle is as wanted, by MAVProxy's own state."""
    until, now = time.monotonic() + PATIENCE, State()
    while time.monotonic() < until:
        now = state(proxy, kind)
        if is_it(now):
            return now
        time.sleep(0.1)
    raise AssertionError(f"not within {PATIENCE:.0f} s; the last state was {now}")


def place(now: State) -> Place:
    """m, local NED."""
    return now["x"], now["y"], now["z"]


def still(now: State) -> bool:
    """Whether it has stopped."""
    return max(abs(now["vx"]), abs(now["vy"]), abs(now["vz"])) < 0.02


def at_rest(proxy: MavProxy, kind: str = "LOCAL_POSITION_NED") -> State:
    """As soon as it has been still for a second: a position controller that overshoots is still for a moment,
    too."""
    until, since, now = time.monotonic() + PATIENCE, math.inf, State()
    while time.monotonic() < until:
        now = state(proxy, kind)
        since = min(since, time.monotonic()) if still(now) else math.inf
        if time.monotonic() - since >= 1.0:
            return now
        time.sleep(0.1)
    raise AssertionError(f"not at rest within {PATIENCE:.0f} s; the last state was {now}")


def rise(proxy: MavProxy) -> Place:
    """Mode, arm, takeoff; and where it ends."""
    # Not by "Mode GUIDED": MAVProxy announces modes at most every two seconds, whichever vehicle has them.
    proxy.ask("mode GUIDED", "DO_SET_MODE: ACCEPTED")
    proxy.ask("arm throttle", "^ARMED")
    proxy.ask(f"takeoff {HEIGHT}", "NAV_TAKEOFF: ACCEPTED")
    return place(when(proxy, lambda now: -now["z"] > HEIGHT - 0.05))


def sink(proxy: MavProxy) -> None:
    """Land, until it disarms."""
    proxy.ask("mode LAND", "DO_SET_MODE: ACCEPTED")
    proxy.expect("^DISARMED")


class MavProxyFlight:
    """One vehicle: what was told, and where it was after each command."""

    def __init__(self, interpreter: Path, endpoint: str, folder: Path) -> None:
        (folder / "plan.txt").write_text(PLAN)
        with MavProxy(interpreter, endpoint, folder) as proxy:
            self.proxy = proxy
            proxy.expect("online system 1")
            self.parameters = int(proxy.expect(r"Received (\d+) parameters").group(1))
            self._change()
            self._lists()
            self.up = rise(proxy)
            self._steer()
            sink(proxy)
            self.down = place(state(proxy))

    def _change(self) -> None:
        """How fast it lands, which saves time as well."""
        proxy = self.proxy
        proxy.type("param set LAND_SPEED 200")
        until = time.monotonic() + PATIENCE
        # It says nothing when it has been set.
        while (now := float(proxy.ask("param show LAND_SPEED", r"LAND_SPEED +([\d.]+)").group(1))) != 200.0:
            assert time.monotonic() < until, f"LAND_SPEED is still {now}"
            time.sleep(0.1)

    def _lists(self) -> None:
        proxy = self.proxy
        proxy.ask("wp load plan.txt", "MISSION_ACK: TYPE_MISSION: ACCEPTED")
        self.waypoints = int(proxy.ask("wp list", r"Requesting (\d+) waypoints").group(1))
        proxy.expect("Saved waypoints")
        self.fences = int(proxy.ask("fence list", r"Requesting (\d+) fence items").group(1))
        self.rallies = int(proxy.ask("rally list", r"Requesting (\d+) rally items").group(1))

    def _steer(self) -> None:
        """``velocity`` and ``position`` go along the vehicle's own axes, which still lie north and east."""
        proxy = self.proxy
        proxy.type("velocity 1 0 0")
        moving = when(proxy, lambda now: abs(now["vx"] - 1.0) < 0.1)
        self.velocity = moving["vx"], moving["vy"], moving["vz"]
        proxy.type("velocity 0 0 0")
        self.before = place(at_rest(proxy))
        proxy.type("position 3 2 -1")
        when(proxy, lambda now: not still(now))
        self.after = place(at_rest(proxy))
        latitude, longitude, height = GOAL
        proxy.ask(f"guided {latitude} {longitude} {height}", "DO_REPOSITION: ACCEPTED")
        when(proxy, lambda now: not still(now))
        at_rest(proxy)
        there = state(proxy, "GLOBAL_POSITION_INT")
        self.there = there["lat"] / 1e7, there["lon"] / 1e7, there["relative_alt"] / 1e3


class MavProxySwarm:
    """Several vehicles on one port: up, one after the other, and down again. ``heights`` (m) by system id."""

    def __init__(self, interpreter: Path, endpoint: str, folder: Path, systems: list[int]) -> None:
        self.heights: dict[int, float] = {}
        with MavProxy(interpreter, endpoint, folder) as proxy:
            self.proxy = proxy
            first = int(proxy.expect(r"online system (\d+)").group(1))
            proxy.expect(r"Received \d+ parameters")
            order = [first, *(system for system in systems if system != first)]
            for system in order:
                if system != first:
                    # Both, in either order: parameters by FTP arrive before the next heartbeat.
                    self._turn_to(system, r"^DISARMED$|Received \d+ parameters")
                    proxy.expect(r"^DISARMED$|Received \d+ parameters")
                self.heights[system] = -rise(proxy)[2]
            for system in reversed(order):
                if system != order[-1]:
                    self._turn_to(system, "^ARMED$")
                sink(proxy)

    def _turn_to(self, system: int, state: str) -> None:
        """Until a heartbeat has come of this one, by which MAVProxy knows its ``state``."""
        self.proxy.ask(f"vehicle {system}", rf"Set vehicle {system}\b")
        self.proxy.expect(state)
