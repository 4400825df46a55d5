"""Simulations of real firmware: how they are started, and what is said where they cannot be."""

from __future__ import annotations

import os
import shlex
import socket
import sys

import pytest

from mavlink_bridge.frames import FleetFrame
from outrider.errors import InputError, OutriderError
from trials.autopilots import Program
from trials.firmware import Firmware, launch

FLEET = FleetFrame(47.397742, 8.545594, 488.0)


def program(path, text):
    """A Python program. No kernel starts an interpreter whose path is long or has spaces; a shell does."""
    path.parent.mkdir(parents=True, exist_ok=True)
    start = f"#!/bin/sh\n'''exec' {shlex.quote(sys.executable)} \"$0\" \"$@\"\n' '''"
    path.write_text(f"{start}\n{text}\n", encoding="utf-8")
    path.chmod(0o755)
    return path


def value_of(command, option):
    return command[command.index(option) + 1]


def test_an_arducopter_is_one_of_a_row(tmp_path) -> None:
    path = program(tmp_path / "arducopter", "")
    found = launch(Program("ardupilot", str(path), ("--model", "quad")), 3, FLEET)
    assert found.command[0] == str(path)
    assert (value_of(found.command, "--sysid"), value_of(found.command, "--model")) == ("3", "quad")
    assert "-I2" in found.command
    latitude, longitude, altitude, _ = map(float, value_of(found.command, "--home").split(","))
    assert FLEET.to_enu(latitude, longitude, altitude) == pytest.approx([10.0, 0.0, 0.0], abs=0.002)
    assert (found.endpoint, found.told) == ("tcp:127.0.0.1:5780", "tcp:127.0.0.1:5782")
    apart = launch(Program("ardupilot", str(path), ("--model", "quad")), 3, FLEET, 7.5)
    latitude, longitude, altitude, _ = map(float, value_of(apart.command, "--home").split(","))
    assert FLEET.to_enu(latitude, longitude, altitude) == pytest.approx([15.0, 0.0, 0.0], abs=0.002)


@pytest.mark.parametrize("named", ["", "bin/px4"])
def test_a_px4_is_found_by_its_build_or_its_binary(tmp_path, named: str) -> None:
    binary = program(tmp_path / "bin" / "px4", "")
    (tmp_path / "etc").mkdir()
    found = launch(Program("px4", str(tmp_path / named), ("PX4_PARAM_MPC_ACC_HOR=3",)), 2, FLEET)
    assert found.command == (str(binary), "-i", "1", "-d", str(tmp_path / "etc"))
    place = [float(found.environment[f"PX4_HOME_{name}"]) for name in ("LAT", "LON", "ALT")]
    assert FLEET.to_enu(*place) == pytest.approx([5.0, 0.0, 0.0], abs=0.002)
    assert found.environment["PX4_PARAM_MPC_ACC_HOR"] == "3"
    assert (found.endpoint, found.told) == ("udpin:127.0.0.1:14541", "udpin:127.0.0.1:14550")


def test_what_is_no_program_is_said(tmp_path) -> None:
    (tmp_path / "text").write_text("no program", encoding="utf-8")
    with pytest.raises(InputError, match="is no program; name build/sitl/bin/arducopter"):
        launch(Program("ardupilot", str(tmp_path / "text")), 1, FLEET)
    with pytest.raises(InputError, match="no build of PX4"):
        launch(Program("px4", str(tmp_path)), 1, FLEET)


@pytest.fixture
def elsewhere(monkeypatch):
    """Ports that nothing else on this computer has."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    monkeypatch.setattr("trials.firmware._TCP", {"ardupilot": (port, port, port), "px4": ()})
    return port


def test_one_that_ends_is_named_with_its_last_words(tmp_path, elsewhere) -> None:
    path = program(tmp_path / "arducopter", "print('no such frame'); raise SystemExit(3)")
    firmware = Firmware({1: Program("ardupilot", str(path))}, FLEET, tmp_path)
    try:
        firmware.processes[1].wait(30)
        with pytest.raises(OutriderError, match=r"(?s)vehicle 1 ended, status 3: .*no such frame"):
            firmware.check()
    finally:
        firmware.close()


def test_those_that_run_are_ended_each_in_a_folder_of_its_own(tmp_path, elsewhere) -> None:
    path = program(
        tmp_path / "arducopter", "import os, time; print(os.getcwd(), flush=True); time.sleep(600)"
    )
    firmware = Firmware({k: Program("ardupilot", str(path)) for k in (1, 2)}, FLEET, tmp_path)
    firmware.check()
    firmware.close()
    assert all(process.poll() is not None for process in firmware.processes.values())
    assert sorted(os.listdir(tmp_path)) == ["arducopter", "firmware-1", "firmware-2"]


def test_a_port_in_use_is_named(tmp_path, elsewhere) -> None:
    path = program(tmp_path / "arducopter", "")
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", elsewhere))
        taken.listen()
        with pytest.raises(InputError, match=f"TCP port {elsewhere} of vehicle 1"):
            Firmware({1: Program("ardupilot", str(path))}, FLEET, tmp_path)
