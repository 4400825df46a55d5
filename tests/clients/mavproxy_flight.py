"""A flight at MAVProxy's prompt."""

from __future__ import annotations

import math
import re
import time
from pathlib import Path
from typing import Final

from mavproxy_console import PATIENCE, MavProxy

HEIGHT: Final = 5.0
PLAN: Final = """QGC WPL 110
0 1 0 16 0 0 0 0 47.3977420 8.5455940 488.0 1
1 0 3 22 0 0 0 0 0.0 0.0 5.0 1
2 0 3 16 0 0 0 0 47.3978000 8.5456000 5.0 1
"""
_STATE: Final = re.compile(r"(\w+) : (-?[\d.]+(?:e-?\d+)?)")


def state(proxy: MavProxy) -> dict[str, float]:
    """The newest LOCAL_POSITION_NED that MAVProxy has."""
    shown = proxy.ask("status LOCAL_POSITION_NED", r"LOCAL_POSITION_NED \{(.*)\}").group(1)
    return {name: float(value) for name, value in _STATE.findall(shown)}


def when(proxy: MavProxy, is_it: object) -> dict[str, float]:
    """As soon as the vehicle is as wanted, by MAVProxy's own state."""
    assert callable(is_it)
    until = time.monotonic() + PATIENCE
    now: dict[str, float] = {}
    while time.monotonic() < until:
        now = state(proxy)
        if is_it(now):
            return now
        time.sleep(0.1)
    raise AssertionError(f"not within {PATIENCE:.0f} s; the last state was {now}")


def place(now: dict[str, float]) -> tuple[float, float, float]:
    return now["x"], now["y"], now["z"]


class MavProxyFlight:
    """What was seen: places (m, local NED) and velocities (m/s) after each command."""

    def __init__(self, interpreter: Path, endpoint: str, folder: Path) -> None:
        (folder / "plan.txt").write_text(PLAN.replace(" ", "\t"))
        with MavProxy(interpreter, endpoint, folder) as proxy:
            self.proxy = proxy
            self.fly()

    def fly(self) -> None:
        """Connect, look, fly, land."""
        proxy = self.proxy
        proxy.expect("online system")
        self.parameters = int(proxy.expect(r"Received (\d+) parameters").group(1))
        self.was = float(proxy.ask("param show WPNAV_SPEED", r"WPNAV_SPEED +([\d.]+)").group(1))
        proxy.type("param set WPNAV_SPEED 600")
        time.sleep(0.5)
        self.now = float(proxy.ask("param show WPNAV_SPEED", r"WPNAV_SPEED +([\d.]+)").group(1))
        self.lists()
        proxy.ask("mode GUIDED", "^Mode GUIDED")
        proxy.ask("arm throttle", "^ARMED")
        proxy.ask(f"takeoff {HEIGHT}", "NAV_TAKEOFF: ACCEPTED")
        self.up = place(when(proxy, lambda now: -now["z"] > HEIGHT - 0.1))
        self.steer()
        proxy.ask("mode LAND", "^Mode LAND")
        proxy.expect("^DISARMED")
        self.down = place(state(proxy))

    def lists(self) -> None:
        """A mission up and down; no fence and no rally points."""
        proxy = self.proxy
        proxy.ask("wp load plan.txt", "MISSION_ACK: TYPE_MISSION: ACCEPTED")
        self.waypoints = int(proxy.ask("wp list", r"Requesting (\d+) waypoints").group(1))
        proxy.expect("Saved waypoints")
        self.fences = int(proxy.ask("fence list", r"Requesting (\d+) fence items").group(1))
        self.rallies = int(proxy.ask("rally list", r"Requesting (\d+) rally items").group(1))

    def steer(self) -> None:
        """By velocity and by offset along the vehicle's own axes, and to a place on earth."""
        proxy = self.proxy
        proxy.type("velocity 1 0 0")
        moving = when(proxy, lambda now: now["vx"] > 0.9)
        self.velocity = moving["vx"], moving["vy"], moving["vz"]
        here = place(state(proxy))
        proxy.type("position 3 2 1")
        self.moved_from = here
        self.moved_to = place(when(proxy, lambda now: math.hypot(now["vx"], now["vy"]) < 0.02))
