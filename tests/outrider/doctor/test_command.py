"""``outrider doctor`` as people start it. The tests with sockets really wait; they assert no timing."""

from __future__ import annotations

import json
import socket
from collections import deque
from pathlib import Path

import pytest

from mavlink_bridge.clocks.clock import SimulatedClock
from mavlink_bridge.links.link import BURST, LinkCounters
from mavlink_bridge.wire.codec import Codec
from outrider.doctor.command import consult
from outrider.doctor.consultation import Consultation
from tests.clients.sitl_process import Sitl
from tests.outrider.doctor.bench import Bench, autopilot
from tests.outrider.said import Run


class Wire:
    """A link at whose other end is a bench: each look at it lets one tick pass there."""

    def __init__(self, bench: Bench) -> None:
        self._bench, self._sent = bench, deque[bytes](maxlen=BURST)

    @property
    def counters(self) -> LinkCounters:
        return LinkCounters(0, 0, 0)

    def fileno(self) -> None:
        return None

    def receive(self) -> list[bytes]:
        said = [message for data in self._sent for message in Codec().feed(data)]
        self._sent.clear()
        return self._bench.tick(*said)

    def send(self, data: bytes) -> None:
        self._sent.append(data)

    def close(self) -> None:
        pass


def test_it_takes_no_longer_than_it_has_to() -> None:
    clock = SimulatedClock(1_000_000)
    verdict = consult(Wire(Bench(autopilot("px4"))), clock, Consultation(60_000_000))
    assert verdict.ready
    assert clock.now() < 10_000_000


def test_it_does_not_wait_for_ever() -> None:
    clock = SimulatedClock()
    assert not consult(Wire(Bench()), clock, Consultation(7_000_000)).ready
    assert 7_000_000 <= clock.now() < 8_000_000


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("carrier:pigeon",), "no endpoint begins with 'carrier'; allowed are udpin:HOST:PORT"),
        (("tlog:nothing.tlog",), "nothing.tlog: no such file; allowed: a .tlog, or a .tlog.gz"),
        (("tlog:.",), ".: is no file; allowed: a .tlog, or a .tlog.gz"),
        (("/dev/nothing,57600",), "/dev/nothing"),
        (("tlog:nothing.tlog", "--key", "fleet.key"), "--key is for live links"),
        (("udpin:127.0.0.1:14999", "--key", "fleet.key"), "fleet.key"),
        (("udpin:127.0.0.1:14999", "--system", "256"), "--system"),
        (("udpin:127.0.0.1:14999", "--seconds", "0"), "--seconds"),
    ],
)
def test_bad_input_is_one_line(run: Run, arguments: tuple[str, ...], words: str) -> None:
    status, out, err = run("doctor", *arguments)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert words in err


def test_a_file_that_is_no_log(run: Run) -> None:
    Path("text.tlog").write_text("no MAVLink here\n" * 100)
    status, _, err = run("doctor", "tlog:text.tlog")
    assert (status, err) == (2, "doctor text.tlog: holds no MAVLink frame; allowed: a .tlog, or a .tlog.gz\n")


def test_a_port_that_somebody_has(run: Run) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        status, out, err = run("doctor", f"udpin:127.0.0.1:{other.getsockname()[1]}")
    assert (status, out, err.count("\n")) == (2, "", 1)


def test_nobody_there(run: Run) -> None:
    status, out, _ = run("doctor", "udpin:127.0.0.1:0", "--seconds", "1", "--json")
    value = json.loads(out)
    assert (status, value["ready"]) == (1, False)
    assert [finding["what"] for finding in value["findings"]] == ["nothing arrives in 1 s"]


@pytest.mark.slow
def test_vehicles_of_ours_over_sockets(run: Run) -> None:
    with Sitl("ardupilot", 2) as sitl:
        sitl.start()
        status, out, err = run("doctor", f"tcp:127.0.0.1:{sitl.base}", "--json")
        value = json.loads(out)
        assert (status, err, value["ready"]) == (0, "", True)
        whats = [finding["what"] for finding in value["findings"]]
        assert "ArduPilot 4.6.3, hexarotor, system 1" in whats
        assert "GUID_TIMEOUT = 3" in whats
        status, out, _ = run("doctor", f"udpin:127.0.0.1:{sitl.shared}", "--system", "2")
        assert status == 0
        assert "another vehicle on this link: system 1" in out
