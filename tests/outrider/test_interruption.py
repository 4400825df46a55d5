"""Whoever stops a flight hears what is left of it."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from mavlink_bridge.tlog.log import read_tlog
from outrider.errors import OutriderError
from outrider.interruption import ReceivedSignal, insisted, interruptible, noted
from outrider.simulation.conductor import Stage
from outrider.simulation.preparation import Prepared
from outrider.swarm.command import fly
from tests.outrider.shipped import FIREFLY, scenario


@pytest.mark.usefixtures("ctrl_c")
@pytest.mark.parametrize("which", [signal.SIGINT, signal.SIGTERM])
def test_a_stopped_flight_says_what_is_left_and_leaves_whole_logs(
    which: signal.Signals, tmp_path: Path
) -> None:
    of = scenario("antipodal-8", vehicles=2, airborne=True)

    def watch(stage: Stage, seconds: float) -> None:
        if stage is Stage.CLOCK and seconds > 0.2:
            os.kill(os.getpid(), which)

    before = signal.getsignal(which)
    with pytest.raises(OutriderError, match="logs up to there, but no summary") as caught:
        fly(Prepared(of, FIREFLY), 1, tmp_path, watch)
    assert caught.value.exit_status == 3
    assert str(tmp_path) in str(caught.value)
    assert "\n" not in str(caught.value)
    assert signal.getsignal(which) is before
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "configuration.yaml",
        "vehicle-11.steps.npz",
        "vehicle-11.tlog",
        "vehicle-12.steps.npz",
        "vehicle-12.tlog",
    ]
    for system in of.systems:
        log = read_tlog(tmp_path / f"vehicle-{system}.tlog")
        assert log.report.skipped_bytes == 0


def test_what_is_not_stopped_is_left_alone() -> None:
    before = signal.getsignal(signal.SIGTERM)
    with interruptible("nothing"):
        assert signal.getsignal(signal.SIGTERM) is not before
    assert signal.getsignal(signal.SIGTERM) is before
    with pytest.raises(ZeroDivisionError), interruptible("nothing"):
        raise ZeroDivisionError


@pytest.fixture
def background() -> Iterator[None]:
    """As a shell starts what a script puts into the background: SIGINT is ignored."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("background")
def test_in_the_background_sigterm_stops_and_ctrl_c_does_not() -> None:
    with interruptible("nothing"):
        os.kill(os.getpid(), signal.SIGINT)
    with pytest.raises(OutriderError, match="stopped; all is kept"), interruptible("all is kept"):
        os.kill(os.getpid(), signal.SIGTERM)


@pytest.mark.usefixtures("background", "ctrl_c")
def test_tests_of_ctrl_c_hear_it_in_the_background_too() -> None:
    with pytest.raises(OutriderError, match="stopped; all is kept"), interruptible("all is kept"):
        os.kill(os.getpid(), signal.SIGINT)


def test_what_comes_twice_in_a_moment_came_once() -> None:
    """``timeout`` signals its command, and then its command's group."""
    with noted([signal.SIGTERM]) as came:
        for _ in range(2):
            os.kill(os.getpid(), signal.SIGTERM)
    assert [one.which for one in came] == [signal.SIGTERM] * 2
    first = ReceivedSignal(signal.SIGTERM, 100.0)
    assert not insisted([])
    assert not insisted(
        [first, ReceivedSignal(signal.SIGTERM, 100.005), ReceivedSignal(signal.SIGHUP, 100.9)]
    )
    assert insisted([first, ReceivedSignal(signal.SIGTERM, 100.005), ReceivedSignal(signal.SIGTERM, 101.2)])
