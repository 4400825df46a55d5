"""``outrider fly`` on vehicles of ``outrider sitl``: up, around a target, down; and what is left when it
ends, whatever the reason. All go by one clock that waits for the slowest."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

from tests.outrider.onboard.lockstep import flight
from tests.outrider.onboard.process import GUIDED, HELD, is_gone

pytestmark = pytest.mark.slow


def test_up_around_the_target_and_back(tmp_path: Path) -> None:
    with flight(tmp_path, "ardupilot", 5.0, clock="auto") as (flying, ear):
        flying.order("go")
        flying.sees("waiting", "the operator's go")
        assert ear.mode() == 0
        flying.order("go")
        flying.sees("phase", "escort")
        flying.wait(2.0)
        flying.order("hold")
        flying.sees("phase", "hold")
        flying.order("retrun")
        flying.sees("answer", "did you mean return?")
        flying.order("return")
        flying.sees("phase", "return")
        status, said = flying.end()
    assert (status, said["ended"], said["fault"]) == (0, "landed", False)
    assert [phase["phase"] for phase in said["phases"]][-4:] == ["return", "settle", "land", "done"]
    assert said["autopilot"] == "ArduPilot"
    assert said["setpoint_faults"] == []
    assert said["setpoints"]["count"] > 100
    assert said["clock_rate"] == pytest.approx(5.0, rel=0.2)
    assert said["last_word"] == "not armed"
    assert {"400": 1, "22": 1}.items() <= said["commands"].items()
    names = {path.name for path in flying.directory.iterdir()}
    assert names == {
        "configuration.yaml",
        "events.jsonl",
        "summary.json",
        "vehicle-1.steps.npz",
        "vehicle-1.tlog",
    }


def test_a_companion_that_is_killed_leaves_a_vehicle_that_holds(tmp_path: Path) -> None:
    """Another one follows, which takes the vehicle over at a new go."""
    with flight(tmp_path, "px4", 5.0, "--go") as (flying, ear):
        flying.sees("phase", "escort")
        flying.until(lambda: ear.mode() == GUIDED["px4"])
        os.kill(flying.pilot, signal.SIGKILL)
        flying.sees("last word", "holds (HOLD)")
        flying.until(lambda: ear.mode() == HELD["px4"])
        flying.until(lambda: flying.events[-1]["text"] == "the operator's go")
        assert ear.mode() == HELD["px4"]
        flying.order("go")
        flying.until(lambda: ear.mode() == GUIDED["px4"])
        flying.wait(0.5)
        status, said = flying.end(signal.SIGINT)
        assert (status, said["fault"], len(said["restarts"])) == (0, False, 1)
        assert said["last_word"].startswith("holds")
    assert (flying.directory / "restart-1" / "vehicle-1.tlog").exists()


@pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
def test_sigterm_lets_it_hold(tmp_path: Path, flavour: str) -> None:
    with flight(tmp_path, flavour, 5.0, "--go") as (flying, ear):
        flying.sees("phase", "escort")
        flying.wait(0.5)
        status, said = flying.end(signal.SIGTERM)
        assert (status, said["ended"], said["fault"]) == (0, "stopped by SIGTERM", False)
        assert said["last_word"].startswith("holds")
        flying.until_vehicle(lambda: ear.mode() == HELD[flavour], 100)


def test_a_group_that_is_signalled_and_not_read_leaves_a_vehicle_that_holds(tmp_path: Path) -> None:
    """As by Ctrl-\\, by ``timeout``, or by a terminal that is closed: all are signalled, some twice."""
    with flight(tmp_path, "ardupilot", 5.0, "--go") as (flying, ear):
        flying.sees("phase", "escort")
        assert flying.process.stderr is not None
        flying.process.stderr.close()
        for which in (signal.SIGQUIT, signal.SIGTERM, signal.SIGTERM, signal.SIGTTOU):
            os.killpg(flying.process.pid, which)
        status, said = flying.end()
        assert (status, said["ended"], said["fault"]) == (0, "stopped by SIGQUIT", False)
        assert said["restarts"] == []
        assert said["last_word"] == "holds (BRAKE)"
        flying.until_vehicle(lambda: ear.mode() == HELD["ardupilot"], 100)


def test_who_is_left_alone_holds_and_ends(tmp_path: Path) -> None:
    """The process that looks after the other is killed."""
    with flight(tmp_path, "ardupilot", 5.0, "--go") as (flying, ear):
        flying.sees("phase", "escort")
        pilot = flying.pilot
        flying.process.kill()
        flying.process.wait()
        flying.until_vehicle(lambda: ear.mode() == HELD["ardupilot"] and is_gone(pilot), 1000)
        flying.process.communicate()


def test_a_dry_run_asks_and_orders_nothing(tmp_path: Path) -> None:
    with flight(tmp_path, "ardupilot", 5.0, "--dry-run") as (flying, ear):
        flying.order("go")
        flying.sees("answer", "a dry run takes no orders")
        flying.sees("waiting", "the operator's go")
        flying.wait(2.0)
        status, said = flying.end(signal.SIGINT)
        assert ear.mode() == 0
    assert (status, said["dry_run"], said["last_word"]) == (0, True, None)
    assert said["commands"].keys() <= {"511", "512"}
    assert said["setpoints"]["count"] > 100
    assert said["setpoint_faults"] == []
    assert said["messages"]["kept_back"] == 0
    assert [phase["phase"] for phase in said["phases"]] == ["connect", "escort"]
