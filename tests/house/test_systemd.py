"""The units in config/systemd are what systemd takes, call the command as it is, and fly nothing by
themselves."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from mavlink_bridge.loops.priority import LEVEL
from outrider.__main__ import main
from outrider.onboard import command
from outrider.onboard.request import Request
from outrider.resources import config_root

UNITS = Path(__file__).parents[2] / "config" / "systemd"
SERVICE = (UNITS / "outrider@.service").read_text(encoding="utf-8")
SOCKET = (UNITS / "outrider@.socket").read_text(encoding="utf-8")
ENVIRONMENT = dict(
    line.split("=", 1)
    for line in (UNITS / "outrider.env").read_text(encoding="utf-8").splitlines()
    if line and not line.startswith("#")
)
PROGRAM = "/opt/outrider/bin/outrider"


def said(unit: str, key: str) -> list[str]:
    """All values of a key."""
    return re.findall(rf"^{key}=(.*)$", unit, re.MULTILINE)


def words(environment: dict[str, str]) -> list[str]:
    """The command as systemd calls it: ``$NAME`` as words, ``${NAME}`` as one."""
    (line,) = said(SERVICE, "ExecStart")
    file = config_root() / "companions" / "px4.yaml"
    found = []
    for word in line.split():
        if word.startswith("${"):
            found.append(environment[word[2:-1]])
        elif word.startswith("$"):
            found += environment[word[1:]].split()
        else:
            found.append(str(file) if word == "/etc/outrider/%i.yaml" else word.replace("%i", "3"))
    return found


def asked(environment: dict[str, str], monkeypatch: pytest.MonkeyPatch) -> Request:
    """What the command understands."""
    requests: list[Request] = []

    def run(request: Request) -> int:
        requests.append(request)
        return 0

    monkeypatch.setattr(command, "run", run)
    monkeypatch.setattr(sys, "argv", words(environment))
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code in (0, None)
    return requests[0]


def test_the_command_understands_it(monkeypatch: pytest.MonkeyPatch) -> None:
    request = asked(ENVIRONMENT, monkeypatch)
    assert (request.system, request.realtime) == (3, True)
    assert str(request.endpoints["autopilot"]) == ENVIRONMENT["AUTOPILOT"]
    assert str(request.endpoints["ground"]) == ENVIRONMENT["AUTOPILOT"]
    assert request.endpoints["target"] == request.endpoints["swarm"]
    assert words(ENVIRONMENT)[0] == PROGRAM


def test_it_steers_nothing_before_somebody_says_so_and_never_takes_off_by_itself(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It is started again and again: what it is told at the start must not be a go."""
    assert asked(ENVIRONMENT, monkeypatch).dry_run
    flying = asked({**ENVIRONMENT, "MORE": ""}, monkeypatch)
    assert not flying.dry_run
    assert not flying.go
    assert flying.seconds is None


def test_it_begins_anew_after_a_fault_and_only_then() -> None:
    assert said(SERVICE, "Restart") == ["on-failure"]
    assert said(SERVICE, "StartLimitIntervalSec") == ["0"]
    assert not said(SERVICE, "RestartForceExitStatus")


def test_whoever_is_left_may_have_the_last_word() -> None:
    """systemd kills the rest at once where the mode is mixed, and the last word takes three seconds."""
    assert said(SERVICE, "KillMode") == ["control-group"]
    assert said(SERVICE, "KillSignal") == ["SIGTERM"]
    assert int(said(SERVICE, "TimeoutStopSec")[0]) >= 20


def test_nothing_forbids_what_it_needs() -> None:
    assert not said(SERVICE, "RestrictRealtime")
    assert not said(SERVICE, "PrivateDevices")
    assert not said(SERVICE, "PrivateNetwork")
    assert int(said(SERVICE, "LimitRTPRIO")[0]) >= LEVEL
    assert said(SERVICE, "LimitMEMLOCK") == ["infinity"]
    ports = {name.split()[0] for name in said(SERVICE, "DeviceAllow")}
    assert ports >= {"char-ttyAMA", "char-ttyUSB", "char-ttyACM"}


def test_orders_come_by_a_pipe_that_is_its_own() -> None:
    (pipe,) = said(SOCKET, "ListenFIFO")
    assert pipe == "/run/outrider-%i.orders"
    assert said(SERVICE, "StandardInput") == ["socket"]
    assert said(SERVICE, "Requires") == ["outrider@%i.socket"]
    assert said(SOCKET, "SocketUser") == said(SERVICE, "User")
    assert int(said(SOCKET, "SocketMode")[0], 8) & 0o007 == 0


def test_the_page_says_how_to_install_them() -> None:
    text = (UNITS.parents[1] / "docs" / "fly.md").read_text(encoding="utf-8")
    for path in UNITS.iterdir():
        assert f"config/systemd/{path.name}" in text
    assert "/run/outrider-1.orders" in text
    assert PROGRAM.rsplit("/", 1)[0].removesuffix("/bin") in text


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="there is no systemd-analyze here")
def test_systemd_takes_them(tmp_path: Path) -> None:
    # The path of the interpreter may have characters that a unit has to escape.
    program = tmp_path / "outrider"
    program.symlink_to(sys.executable)
    for path in UNITS.glob("outrider@.*"):
        text = path.read_text(encoding="utf-8").replace(PROGRAM, str(program))
        (tmp_path / path.name).write_text(text, encoding="utf-8")
    units = [str(tmp_path / name) for name in ("outrider@1.service", "outrider@1.socket")]
    done = subprocess.run(
        ["systemd-analyze", "verify", "--man=no", *units], capture_output=True, text=True, check=False
    )
    wrong = [line for line in done.stderr.splitlines() if "outrider@" in line]
    assert (done.returncode, wrong) == (0, [])
