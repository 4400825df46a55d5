"""What the tests by one clock count on: they end, and what a process has noted is in its file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from threading import Thread

import pytest

from mavlink_bridge.clocks.clock import SimulatedClock
from mavlink_bridge.links.opening import open_link
from outrider.onboard import event_log
from tests.outrider.onboard import process
from tests.outrider.onboard.far_ends import START, Vehicle
from tests.outrider.onboard.in_turns import _Written
from tests.outrider.onboard.process import HOST, Flying, free_port
from tests.outrider.onboard.turns import Conductor


@pytest.mark.parametrize("wait", [lambda one: one.until(lambda: False), lambda one: one.end()])
def test_a_process_that_closes_its_socket_and_goes_on_is_a_failure(
    wait: Callable[[Flying], object], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(process, "ROUNDS", 3)
    conductor = Conductor(START)
    link = open_link(f"udpout:{HOST}:{free_port()}", SimulatedClock(START))
    flying = Flying(tmp_path, conductor, Vehicle("px4", 1.0, link), program="tests.outrider.onboard.silent")
    try:
        with pytest.raises(AssertionError, match="closed its socket and goes on"):
            wait(flying)
        assert flying.process.poll() is None
    finally:
        flying.process.communicate()
        link.close()
        conductor.close()


def test_an_event_is_in_the_file_when_it_has_been_noted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(event_log, "SimpleQueue", _Written)
    log = event_log.EventLog(tmp_path, lambda: 0.0)
    path = tmp_path / event_log.NAME
    for number in range(1, 101):
        log.note("order", "go")
        assert path.read_text(encoding="utf-8").count("\n") == number
    several = [Thread(target=log.note, args=("order", "hold")) for _ in range(10)]
    for one in several:
        one.start()
    for one in several:
        one.join()
    assert path.read_text(encoding="utf-8").count("\n") == 110
    log.close()
