"""A flight whose processes are replaced by a test, from its first child to the loss of the last one."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import pytest

from mavlink_bridge.clocks.clock import SimulatedClock
from mavlink_bridge.links.endpoints import parse_endpoint
from outrider.onboard import flight
from outrider.onboard.event_log import EventLog
from outrider.onboard.flight import Flight
from outrider.onboard.line_input import LineInput
from outrider.onboard.request import Request
from outrider.onboard.wiring import wire
from outrider.scenarios.fly_config import FlyConfig


def flown(
    config: FlyConfig, name: str, process: type, directory: Path, monkeypatch: pytest.MonkeyPatch
) -> Flight:
    """The flight of a companion file called ``name``, whose children are of the class ``process``."""
    monkeypatch.setattr(flight, "ChildProcess", process)
    monkeypatch.setattr(Flight, "_identify", lambda _flight: True)
    endpoint = parse_endpoint("udpin:127.0.0.1:0")
    ends = dict.fromkeys(("autopilot", "swarm", "target", "ground"), endpoint)
    wiring = wire(ends, 1, 100, config.settings, SimulatedClock(1))
    with closing(wiring), closing(EventLog(directory, lambda: 0.0)) as event_log:
        over = Flight(
            Request(config, name, ends), wiring, directory, event_log, LineInput(None), [], lambda: None
        )
        over.run()
    return over
