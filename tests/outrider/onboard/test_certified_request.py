"""What committed plans need is asked for before anything is opened, with what is allowed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from mavlink_bridge.clocks.clock import WallClock
from mavlink_bridge.clocks.system_clock import KernelClock, KernelStatus
from outrider.errors import InputError
from outrider.onboard.clocks import CompanionClock
from outrider.onboard.request import Options, Request, checked
from outrider.scenarios.fly_config import ClockError

AUTOPILOT, LOOPBACK, NETWORK = "udpin:127.0.0.1:14550", "mcast:,127.0.0.1", "mcast:,192.168.42.11"
MEASURED: dict[str, Any] = {"fleet": [1, 2], "fleet_time": "measured"}
BASE: dict[str, Any] = {
    "system": 1,
    "target": 100,
    "origin": {"latitude": 47.4, "longitude": 8.5, "altitude": 488.0},
    "clock": "wall",
}


def asked(
    tmp_path: Path, certified: dict[str, Any] = MEASURED, swarm: str = LOOPBACK, **changes: Any
) -> Request:
    companion = {"task": "goto", "avoidance": "certified", "certified": certified}
    options = {key: changes.pop(key) for key in ("system", "dry_run") if key in changes}
    document = BASE | {"companion": companion} | changes
    path = tmp_path / "own.yaml"
    path.write_text(yaml.safe_dump(document), encoding="utf-8")
    return checked(Options(AUTOPILOT, str(path), swarm, **options))


def test_committed_plans_are_flown_with_measured_time(tmp_path: Path) -> None:
    assert asked(tmp_path).config.certified
    assert asked(tmp_path, swarm=NETWORK).config.certified


@pytest.mark.parametrize(
    ("changes", "wrong"),
    [
        ({"clock": "auto"}, r"clock 'auto'.*allowed.*'wall'"),
        ({"clock": "autopilot"}, r"clock 'autopilot'.*allowed.*'wall'"),
        ({"radio": 57600}, r"radio 57600.*allowed.*null"),
        ({"certified": {"fleet_time": "measured"}}, r"certified\.fleet is empty"),
        ({"system": 3}, r"--system 3: is not in companion\.certified\.fleet; allowed: 1, 2"),
        ({"dry_run": True}, r"allowed with --dry-run: 'field'"),
    ],
)
def test_what_cannot_be_flown_is_refused(tmp_path: Path, changes: dict[str, Any], wrong: str) -> None:
    with pytest.raises(InputError, match=wrong):
        asked(tmp_path, **changes)


@pytest.mark.parametrize("tube", [None, 0.25, 1.0])
def test_a_tube_that_is_not_stated_is_warned_of(
    tmp_path: Path, tube: float | None, capsys: pytest.CaptureFixture[str]
) -> None:
    asked(tmp_path, MEASURED if tube is None else {**MEASURED, "tube": tube})
    assert ("certified.tube: not stated: 0.25 m, which" in capsys.readouterr().err) is (tube is None)


@pytest.mark.parametrize("swarm", [NETWORK, "mcast:", "udpout:127.0.0.1:14551", "/dev/ttyUSB0,921600"])
def test_the_own_clock_counts_only_among_companions_of_one_computer(tmp_path: Path, swarm: str) -> None:
    own = {"fleet": [1, 2]}
    assert asked(tmp_path, own).config.certified
    with pytest.raises(InputError, match=r"allowed with companion\.certified\.fleet_time own: mcast:,127"):
        asked(tmp_path, own, swarm)


def test_the_system_clock_is_read_relative_to_a_clock_with_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    wall = WallClock(0)
    sound = KernelClock(0, lambda: KernelStatus(0, 0, 700), lambda: wall.now() * 1000 + 5_000_000)
    clock = CompanionClock(ClockError(offset_ms=5000.0), wall)
    monkeypatch.setattr(clock, "_kernel", sound)
    reading = clock.system_clock(clock.clock.now())
    assert reading is not None
    assert abs(reading.ahead - (5_000 - 5_000_000)) <= reading.bound
    assert reading.bound >= 700
    exact = CompanionClock(None, wall)
    assert exact.clock is wall


def test_an_undisciplined_system_clock_is_no_source(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = CompanionClock(ClockError(offset_ms=5000.0))
    monkeypatch.setattr(clock, "_kernel", KernelClock(0, lambda: KernelStatus(5, 0x40, 16_000_000)))
    assert clock.system_clock(0) is None
