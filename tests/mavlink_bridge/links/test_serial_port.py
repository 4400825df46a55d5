"""What is peculiar to serial ports: speeds, unplugged cables, forks that share a port."""

from __future__ import annotations

import os
import tty
from pathlib import Path

import pytest

from mavlink_bridge.clocks.clock import SimulatedClock
from mavlink_bridge.errors import LinkError
from mavlink_bridge.links.endpoints import BAUD_RATES, Serial
from mavlink_bridge.links.opening import open_link
from mavlink_bridge.links.serial_port import SerialPort
from mavlink_bridge.links.streams import RETRY, StreamLink
from tests.mavlink_bridge.link_pairs import Terminal, frame, gather, serial, tcp, wait


def test_a_serial_port_changes_no_byte_and_has_its_speed() -> None:
    termios = pytest.importorskip("termios")
    near, far = os.openpty()
    tty.setraw(near)
    port = SerialPort(Serial(os.ttyname(far), 57600), SimulatedClock())
    assert termios.tcgetattr(far)[4:6] == [termios.B57600, termios.B57600]
    os.close(far)
    vehicle = Terminal(near, SimulatedClock())
    garbage = bytes(range(0xFD)) + b"\xff\r\n\x03\x11\x13\x1a\x04"
    for one, other in ((port, vehicle), (vehicle, port)):
        one.send(garbage)
        found = gather(other, lambda found: len(b"".join(found)) == len(garbage), [one])
        assert b"".join(found) == garbage
    port.close()
    vehicle.close()


def test_a_serial_port_with_nothing_to_read_is_still_there() -> None:
    """Also if whoever had it before left VMIN = 0, by which nothing to read looks like an end."""
    termios = pytest.importorskip("termios")
    near, far = os.openpty()
    tty.setraw(near)
    tty.setraw(far)
    found = termios.tcgetattr(far)
    found[6][termios.VMIN], found[6][termios.VTIME] = 0, 0
    termios.tcsetattr(far, termios.TCSANOW, found)
    port = SerialPort(Serial(os.ttyname(far), 57600), SimulatedClock())
    os.close(far)
    vehicle = Terminal(near, SimulatedClock())
    for number in range(3):
        assert port.receive() == []
        vehicle.send(frame(number))
        assert gather(port, bool, [vehicle]) == [frame(number)]
    assert port.peers == 1
    port.close()
    vehicle.close()


def test_a_serial_port_that_was_pulled_out_comes_back(tmp_path: Path) -> None:
    clock, device = SimulatedClock(), tmp_path / "ttyACM0"

    def plug_in() -> Terminal:
        near, far = os.openpty()
        tty.setraw(near)
        device.unlink(missing_ok=True)
        device.symlink_to(os.ttyname(far))
        # The name must lead somewhere until the port is open.
        plugs.append(far)
        return Terminal(near, clock)

    plugs: list[int] = []
    vehicle = plug_in()
    port = SerialPort(Serial(str(device), 57600), clock)
    for number in range(3):
        os.close(plugs.pop())
        port.send(frame(number))
        assert gather(vehicle, bool, [port]) == [frame(number)]
        vehicle.close()
        while port.peers:
            wait(port)
            assert port.receive() == []
        port.send(frame(9))
        assert port.receive() == []
        vehicle = plug_in()
        clock.wait_until(clock.now() + RETRY)
        assert port.receive() == []
        assert port.peers == 1
    os.close(plugs.pop())
    port.close()
    vehicle.close()


def test_who_lets_a_serial_port_go_has_no_file_of_it_and_the_fork_goes_on() -> None:
    """A port that was pulled out keeps its name until the last one has closed it."""
    here, there = serial()
    assert isinstance(here, SerialPort)
    name = os.ttyname(here._streams[0].fileno())
    (read, write), number = os.pipe(), frame(1)
    child = os.fork()
    if not child:
        # After the parent has let go.
        os.read(read, 1)
        here.send(number)
        os._exit(0 if here.counters.sent else 1)
    here.let_go()
    files = {
        os.readlink(f"/proc/self/fd/{file}")
        for file in os.listdir("/proc/self/fd")
        if file.isdigit() and os.path.exists(f"/proc/self/fd/{file}")
    }
    assert name not in files
    os.write(write, b"1")
    assert gather(there, bool) == [number]
    assert os.waitpid(child, 0)[1] == 0
    here.send(frame(2))
    assert gather(there, bool) == [frame(2)]
    for end in (read, write):
        os.close(end)
    here.close()
    there.close()


def test_a_fork_that_takes_over_changes_nothing_for_the_other() -> None:
    """Both have the connection: what the fork reads or registers is not the other's."""
    here, there = tcp()
    frames = [frame(number) for number in range(3)]
    (read, write), (told, tell) = os.pipe(), os.pipe()
    child = os.fork()
    if not child:
        found: list[bytes] = []
        try:
            assert isinstance(here, StreamLink)
            here.take_over()
            found = gather(here, bool)
            here.send(frames[1])
        finally:
            os.write(tell, b"1" if found == [frames[0]] else b"0")
            # The other reads only now.
            os.read(read, 1)
            here.close()
            os._exit(0)
    there.send(frames[0])
    assert os.read(told, 1) == b"1"
    assert gather(there, bool) == [frames[1]]
    os.write(write, b"1")
    assert os.waitpid(child, 0)[1] == 0
    # The fork has closed its descriptors: the connection goes on.
    there.send(frames[2])
    assert gather(here, bool) == [frames[2]]
    for end in (read, write, told, tell):
        os.close(end)
    here.close()
    there.close()


def test_who_only_keeps_a_serial_port_open_releases_it_when_it_is_unplugged() -> None:
    near, far = os.openpty()
    port = SerialPort(Serial(os.ttyname(far), 57600), SimulatedClock())
    os.close(far)
    port.release_broken()
    assert port.peers == 1
    os.close(near)
    port.release_broken()
    assert port.peers == 0
    port.close()


def test_a_line_that_is_behind_takes_nothing_more(monkeypatch: pytest.MonkeyPatch) -> None:
    near, far = os.openpty()
    port = SerialPort(Serial(os.ttyname(far), 57600), SimulatedClock())
    waiting = [0]
    monkeypatch.setattr(port, "_queued", lambda: waiting[0])
    # A quarter of a second of 57 600 baud.
    for queued, counters in ((1440, (0, 1, 0)), (1441, (0, 1, 1)), (0, (0, 2, 1))):
        waiting[0] = queued
        port.send(frame(1))
        assert port.counters == counters
    port.close()
    os.close(near)
    os.close(far)


def test_a_speed_that_the_system_does_not_know_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    termios = pytest.importorskip("termios")
    monkeypatch.delattr(termios, f"B{BAUD_RATES[-1]}", raising=False)
    with pytest.raises(LinkError, match="knows no 4000000 baud"):
        open_link(Serial("/dev/null", BAUD_RATES[-1]), SimulatedClock())
