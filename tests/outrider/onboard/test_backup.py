"""The parent keeps a backup process running, and is told when there is nothing to be flown. These tests wait
for processes; they assert no timing."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest

from mavlink_bridge.clocks.clock import WallClock
from mavlink_bridge.links.endpoints import parse_endpoint
from outrider.onboard.backup import Backup
from outrider.onboard.request import Request
from outrider.onboard.wiring import wire
from outrider.scenarios.fly_config import FlyConfig
from tests.outrider.onboard.process import PATIENCE, is_gone
from tests.outrider.onboard.test_certified_request import BASE, MEASURED

CONFIG = FlyConfig.model_validate(
    BASE | {"companion": {"task": "goto", "avoidance": "certified", "certified": MEASURED}}
)


class Rig:
    """A backup process with the events that its parent tells."""

    def __init__(self, backup: Backup, events: list[tuple[str, str]]) -> None:
        self.backup, self.events = backup, events

    @property
    def processes(self) -> list[int]:
        return [int(text.rpartition(" ")[2]) for what, text in self.events if what == "process"]

    def until(self, is_so: Callable[[], object]) -> None:
        end = time.monotonic() + PATIENCE
        while not is_so():
            assert time.monotonic() < end, self.events
            self.backup.look()
            time.sleep(0.01)


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    endpoint = parse_endpoint("udpin:127.0.0.1:0")
    ends = dict.fromkeys(("autopilot", "swarm", "target", "ground"), endpoint)
    events: list[tuple[str, str]] = []
    clock = WallClock()
    with closing(wire(ends, 1, 100, CONFIG.settings, clock)) as wiring:
        asked = Request(CONFIG, "own", ends)
        backup = Backup(
            asked, wiring, clock, lambda: 0, lambda what, text: events.append((what, text)), tmp_path
        )
        with closing(backup):
            backup.start()
            yield Rig(backup, events)


def test_one_that_is_killed_is_started_again(rig: Rig) -> None:
    os.kill(rig.processes[0], signal.SIGKILL)
    rig.until(lambda: len(rig.processes) == 2)
    assert ("concern", "the backup node is lost") in rig.events
    assert not is_gone(rig.processes[1])


def test_without_a_plan_there_is_nothing_to_fly(rig: Rig) -> None:
    looks: list[None] = []
    assert rig.backup.relieve(lambda: looks.append(None)) is None
    assert rig.backup.carried == 0


def test_one_that_is_lost_has_nothing_to_say(rig: Rig) -> None:
    os.kill(rig.processes[0], signal.SIGKILL)
    assert rig.backup.relieve(lambda: None) is None


def test_it_ends_with_its_parents_handle(rig: Rig, tmp_path: Path) -> None:
    rig.until((tmp_path / "backup-1" / "vehicle-1.tlog").exists)
    rig.backup.close()
    assert is_gone(rig.processes[0])


def test_it_ends_when_companion_and_parent_are_gone(tmp_path: Path) -> None:
    """A parent that is killed tells nobody: its end shows."""
    read, write = os.pipe()
    parent = os.fork()
    if not parent:
        endpoint = parse_endpoint("udpin:127.0.0.1:0")
        ends = dict.fromkeys(("autopilot", "swarm", "target", "ground"), endpoint)
        clock = WallClock()
        wiring = wire(ends, 1, 100, CONFIG.settings, clock)
        asked = Request(CONFIG, "own", ends)
        told: list[str] = []
        backup = Backup(asked, wiring, clock, lambda: 0, lambda _what, text: told.append(text), tmp_path)
        backup.start()
        os.write(write, told[0].rpartition(" ")[2].encode())
        os.kill(os.getpid(), signal.SIGKILL)
    os.waitpid(parent, 0)
    process = int(os.read(read, 100))
    end = time.monotonic() + PATIENCE
    while not is_gone(process):
        assert time.monotonic() < end
        time.sleep(0.01)
    os.close(read)
    os.close(write)
