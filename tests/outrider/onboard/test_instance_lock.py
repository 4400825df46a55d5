"""One companion for a vehicle on one computer, whoever runs it, and whoever else flies there."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from mavlink_bridge.links.endpoints import Endpoint, parse_endpoint
from outrider.errors import InputError
from outrider.onboard import instance_lock as module
from outrider.onboard.instance_lock import instance_lock

AUTOPILOT = parse_endpoint("udpin:127.0.0.1:14550")
OTHER = parse_endpoint("tcp:127.0.0.1:5760")
SERIAL = parse_endpoint("/dev/ttyACM0,57600")
HOLDS = """
import os, sys
sys.argv = ["/usr/bin/outrider", "fly", "--system", "1"]
from mavlink_bridge.links.endpoints import parse_endpoint
from outrider.onboard.instance_lock import instance_lock
with instance_lock(1, parse_endpoint(sys.stdin.readline().strip())):
    if sys.stdin.readline() == "leave a child\\n" and os.fork():
        os.write(1, b"held by a child\\n")
        os._exit(0)
    os.write(1, b"held\\n")
    sys.stdin.readline()
"""


@pytest.fixture(autouse=True)
def runtime(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The user's runtime folder."""
    folder = tmp_path / "run"
    folder.mkdir(mode=0o700)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(folder))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    return folder


def refused(system: int = 1, endpoint: Endpoint = AUTOPILOT) -> str:
    """Why it is; empty if it is not."""
    try:
        with instance_lock(system, endpoint):
            return ""
    except InputError as error:
        return str(error)


def test_one_vehicle_has_one_companion_and_its_end_leaves_room() -> None:
    with instance_lock(1, AUTOPILOT):
        assert "another outrider fly has vehicle 1 there" in refused()
        assert not refused(2)
        assert not refused(1, OTHER)
    assert not refused()


def test_the_refusal_names_the_process(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", ["/opt/bin/outrider", "fly", "--config", "my file.yaml"])
    with instance_lock(1, AUTOPILOT):
        said = refused()
    assert f"(process {os.getpid()}: outrider fly --config 'my file.yaml'); allowed: one for each" in said


def holding(*lines: str, prefix: tuple[str, ...] = ()) -> subprocess.Popen[str]:
    """A process that holds the lock until it is told to end."""
    process = subprocess.Popen(
        [*prefix, sys.executable, "-c", HOLDS], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert process.stdin is not None
    process.stdin.write("".join(f"{line}\n" for line in (str(AUTOPILOT), *lines)))
    process.stdin.flush()
    return process


def test_it_is_held_between_processes_and_goes_with_them() -> None:
    with holding("") as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        assert f"(process {process.pid}: outrider fly --system 1)" in refused()
        process.communicate("\n")
    assert not refused()


def test_a_child_that_is_left_holds_it_and_is_told_of() -> None:
    with holding("leave a child") as process:
        assert process.stdout is not None
        assert {process.stdout.readline(), process.stdout.readline()} == {"held by a child\n", "held\n"}
        process.wait()
        assert f"(a process that was started by process {process.pid}: outrider fly" in refused()
        process.communicate("\n")
    assert not refused()


@pytest.mark.parametrize("text", ["", "no number", "99999999999999 fly", "²³ fly", "\xff\xfe", "-1 fly"])
def test_what_is_no_process_is_not_named(runtime: Path, text: str) -> None:
    with instance_lock(1, AUTOPILOT):
        (file,) = (runtime / "outrider").iterdir()
        file.write_text(text, encoding="utf-8")
        assert "vehicle 1 there; allowed" in refused()


def test_what_would_steer_a_terminal_does_not(runtime: Path) -> None:
    with instance_lock(1, AUTOPILOT):
        (file,) = (runtime / "outrider").iterdir()
        file.write_text(f"{os.getpid()} \x1b[2J{'long ' * 999}", encoding="utf-8")
        said = refused()
    assert "\x1b" not in said
    assert len(said) < 600


# Where it is kept


def test_it_is_kept_in_the_runtime_folder_of_the_user(runtime: Path, tmp_path: Path) -> None:
    with instance_lock(1, AUTOPILOT):
        (file,) = (runtime / "outrider").iterdir()
    assert file.stat().st_mode & 0o777 == 0o600
    assert (runtime / "outrider").stat().st_mode & 0o777 == 0o700
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


@pytest.mark.parametrize("given", [None, "", "relative", "missing", "open"])
def test_without_one_it_is_kept_in_a_folder_of_ones_own(
    given: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "open").mkdir()
    (tmp_path / "open").chmod(0o777)
    if given is None:
        monkeypatch.delenv("XDG_RUNTIME_DIR")
    else:
        path = given if given in ("", "relative") else str(tmp_path / given)
        monkeypatch.setenv("XDG_RUNTIME_DIR", path)
    with instance_lock(1, AUTOPILOT):
        assert refused()
    folder = tmp_path / f"outrider-{os.getuid()}"
    assert folder.stat().st_mode & 0o777 == 0o700
    assert len(list(folder.iterdir())) == 1


@pytest.mark.parametrize("how", ["open to others", "a link", "a file", "no temporary folder"])
def test_a_folder_that_others_may_have_made_is_not_trusted_and_nothing_stays_on_the_ground(
    how: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("XDG_RUNTIME_DIR")
    folder = tmp_path / f"outrider-{os.getuid()}"
    if how == "open to others":
        folder.mkdir()
        folder.chmod(0o777)
    elif how == "a link":
        folder.symlink_to(tmp_path / "run")
    elif how == "a file":
        folder.touch()
    else:
        monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "missing"))
    with instance_lock(1, AUTOPILOT):
        assert not refused()
    assert not list((tmp_path / "run").iterdir())


# What it knows of the network


def test_the_same_port_in_another_network_namespace_is_another_place(monkeypatch: pytest.MonkeyPatch) -> None:
    with instance_lock(1, AUTOPILOT), instance_lock(1, SERIAL):
        monkeypatch.setattr(module, "_network", lambda: "another")
        assert not refused()
        # A serial port is one, whichever network its user has.
        assert refused(1, SERIAL)


def test_a_system_without_namespaces_has_one(monkeypatch: pytest.MonkeyPatch) -> None:
    def gone(*_: object, **__: object) -> os.stat_result:
        raise FileNotFoundError

    with monkeypatch.context() as patch:
        patch.setattr(os, "stat", gone)
        assert module._network() == ""
    assert module._network() == module._network()


def test_a_real_namespace() -> None:
    unshare = shutil.which("unshare")
    if unshare is None or subprocess.run([unshare, "-rn", "true"], capture_output=True).returncode:
        pytest.skip("this system gives no network namespace")
    with holding("", prefix=(unshare, "-rn")) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        assert not refused()
        process.communicate("\n")
