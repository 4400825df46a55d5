"""``outrider sitl`` as a process: who connects is answered, and it ends as it should. These tests really
wait; they assert no timing."""

from __future__ import annotations

import json
import os
import random
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any, Final

import pytest

from mavlink_bridge.messages import Heartbeat, Message, ParamSet, ParamValue, Source
from mavlink_bridge.wire.codec import Codec
from tests.outrider.said import Run

HOST: Final = "127.0.0.1"
GCS: Final = Source(255, 190)
PATIENCE: Final = 120.0
"""s until a test gives up; what is waited for comes within a second or two."""


def free_base(flavour: str, count: int) -> int:
    """For ``--port-base``: nobody has its ports, and the system gives them to nobody by itself."""
    offsets = {"ardupilot": (0, 2, 3), "px4": (0, 10, 40, 4030)}[flavour]
    step = 10 if flavour == "ardupilot" else 1
    kind = socket.SOCK_STREAM if flavour == "ardupilot" else socket.SOCK_DGRAM
    while True:
        base = random.choice(range(16_000, 28_000))
        try:
            for port in {base + offset + step * index for offset in offsets for index in range(count)}:
                with socket.socket(socket.AF_INET, kind) as probe:
                    probe.bind((HOST, port))
        except OSError:
            continue
        return base


class Sitl:
    """A running ``outrider sitl``, whose vehicles are up."""

    def __init__(self, *options: str) -> None:
        command = [sys.executable, "-m", "outrider", "sitl", "--json", *options]
        self.process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        assert line, self.process.communicate()[1]
        self.ready: dict[str, Any] = json.loads(line)
        self.vehicles: list[dict[str, Any]] = self.ready["vehicles"]

    def end(self, which: signal.Signals = signal.SIGTERM) -> tuple[int, list[str], str]:
        """Status, what it still said on standard output, and all of standard error."""
        self.process.send_signal(which)
        out, err = self.process.communicate(timeout=PATIENCE)
        return self.process.returncode, out.splitlines(), err


@contextmanager
def sitl(*options: str) -> Iterator[Sitl]:
    running = Sitl(*options)
    try:
        yield running
    finally:
        if running.process.poll() is None:
            running.process.kill()
            running.process.communicate()


def receive(end: socket.socket, kind: type[Message], system: int, said: Message | None = None) -> Any:
    """The first message of that ``kind`` of that ``system``; ``said`` first, if anything."""
    codec = Codec()
    if said is not None:
        end.sendall(Codec().encode(said))
    end.settimeout(PATIENCE)
    while True:
        data = end.recv(65536)
        assert data, "hung up"
        for message in codec.feed(data):
            if isinstance(message, kind) and message.source.system == system:
                return message


def listening(port: int) -> socket.socket:
    end = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    end.bind((HOST, port))
    return end


def port_of(text: str) -> int:
    return int(text.rpartition(":")[2])


def test_ardupilots_several_clients_and_a_shared_port(tmp_path: Path) -> None:
    base = free_base("ardupilot", 3)
    with closing(listening(0)) as shared:
        options = [
            "--count=3",
            f"--port-base={base}",
            f"--to=udpout:{HOST}:{shared.getsockname()[1]}",
            f"--state={tmp_path}",
        ]
        with sitl(*options) as running:
            assert [vehicle["system_id"] for vehicle in running.vehicles] == [1, 2, 3]
            for vehicle in running.vehicles:
                ports = [port_of(text) for text in vehicle["endpoints"][:3]]
                assert port_of(vehicle["pymavlink"]) == port_of(vehicle["mavsdk"]) == ports[0]
                clients = [socket.create_connection((HOST, port)) for port in (*ports, ports[0])]
                for client in clients:
                    assert receive(client, Heartbeat, vehicle["system_id"]).autopilot == 3
                    client.close()
                # All three on one port, too.
                receive(shared, Heartbeat, vehicle["system_id"])
            value = ParamSet(GCS, b"\x00\x80\xa0\x43", 2, 1, "WPNAV_SPEED", 9)
            with socket.create_connection((HOST, port_of(running.vehicles[1]["pymavlink"]))) as client:
                assert receive(client, ParamValue, 2, value).raw == value.raw
            status, out, err = running.end(signal.SIGINT)
        assert status == 0
        (summary,) = map(json.loads, out)
        assert [vehicle["system_id"] for vehicle in summary["vehicles"]] == [1, 2, 3]
        assert all(vehicle["sent"] > 0 for vehicle in summary["vehicles"])
        assert "Traceback" not in err
        for system in (1, 2, 3):
            assert f"vehicle {system} (ardupilot, firefly): tcpin:" in err
    assert [path.name for path in tmp_path.iterdir()] == ["ardupilot-2.json"]


def test_px4s_speak_first_and_answer_who_calls() -> None:
    base = free_base("px4", 2)
    with (
        closing(listening(base)) as first,
        closing(listening(base + 1)) as second,
        closing(listening(base + 10)) as station,
        sitl("--flavour=px4", "--count=2", f"--port-base={base}", "--first-id=41", "--speedup=3") as running,
    ):
        for system, offboard in ((41, first), (42, second)):
            assert receive(offboard, Heartbeat, system).autopilot == 12
            receive(station, Heartbeat, system)
        with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as caller:
            caller.connect((HOST, base + 41))
            receive(caller, Heartbeat, 42, Heartbeat(GCS, 6, 8, 0, 0, 4))
        # Whom others also speak to is still told.
        receive(second, Heartbeat, 42)
        assert running.ready["speedup"] == 3.0
        status, out, _ = running.end()
        assert status == 0
        assert json.loads(out[0])["processes"] >= 2


def children(pid: int) -> list[int]:
    return [int(word) for word in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks into /proc")
def test_nothing_is_left_of_one_that_was_killed() -> None:
    base = free_base("ardupilot", 2)
    with sitl("--count=2", "--speedup=10", f"--port-base={base}") as running:
        left = children(running.process.pid)
        assert left
        running.process.kill()
        running.process.communicate()
        while any(_alive(pid) for pid in left):
            time.sleep(0.01)
    # And its ports are free again.
    with sitl("--count=2", f"--port-base={base}") as running:
        assert running.end()[0] == 0


def _alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks into /proc")
def test_a_process_that_dies_ends_all_with_a_sentence() -> None:
    base = free_base("ardupilot", 2)
    with sitl("--count=2", "--first-id=8", f"--port-base={base}") as running:
        for pid in children(running.process.pid):
            os.kill(pid, signal.SIGKILL)
        out, err = running.process.communicate(timeout=PATIENCE)
        assert running.process.returncode == 3
        assert out == ""
        assert "outrider: vehicles 8, 9: its process ended with status -9" in err


def test_a_port_in_use_is_named_with_what_to_do(run: Run) -> None:
    with closing(socket.create_server((HOST, 0))) as other:
        port = other.getsockname()[1]
        ended = run("sitl", "--json", "--port-base", str(port))
    assert ended.status == 2
    assert ended.out == ""
    (line,) = ended.err.splitlines()
    assert line.startswith(f"tcpin:127.0.0.1:{port}: cannot listen there: Address already in use")
    assert "--port-base" in line


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--flavour", "inav"), "--flavour inav: allowed are ardupilot, px4"),
        (("--count", "0"), "--count"),
        (("--speedup", "0"), "--speedup"),
        (("--speedup", "nan"), "--speedup"),
        (
            ("--first-id", "200", "--count", "100"),
            "--count 100 from --first-id 200: system ids would go up to 299",
        ),
        (("--port-base", "65535"), "--port-base 65535: ports would go up to 65538; allowed is 65535"),
        (("--to", "nonsense"), "--to 'nonsense': no endpoint begins with"),
        (("--to", "tcpin:127.0.0.1:1", "--count", "2"), "only one vehicle can have that"),
        (("--vehicle", "firefli"), "did you mean 'firefly'?"),
        (("--signing-key", "nowhere.key"), "nowhere.key: "),
        (("--origin", "north"), "--origin north: allowed is LATITUDE,LONGITUDE"),
        (("--wind", "strong"), "--wind strong: allowed is a speed in m/s"),
    ],
)
def test_what_cannot_be_done_is_said_in_one_line(options: tuple[str, ...], said: str, run: Run) -> None:
    ended = run("sitl", "--json", *options)
    assert ended.status == 2
    assert ended.out == ""
    (line,) = ended.err.splitlines()
    assert said in line


def test_who_opens_it_to_others_is_warned_and_it_ends_when_it_shall() -> None:
    base = free_base("ardupilot", 1)
    with sitl("--host=0.0.0.0", f"--port-base={base}", "--seconds=0") as running:
        out, err = running.process.communicate(timeout=PATIENCE)
    assert running.process.returncode == 0
    assert len(out.splitlines()) == 1
    warning, *rest = err.splitlines()
    assert warning.startswith(f"outrider sitl: tcpin:0.0.0.0:{base}, ")
    assert "reachable from other machines" in warning
    assert rest
    assert all("vehicle 1" in line for line in rest)
