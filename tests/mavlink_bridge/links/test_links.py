"""What is peculiar to each transport: who is answered, what is ignored, what comes back, what is refused."""

from __future__ import annotations

import gc
import os
import socket
import tty
from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mavlink_bridge.clocks.clock import SimulatedClock
from mavlink_bridge.errors import BridgeError, LinkError
from mavlink_bridge.links.endpoints import BAUD_RATES, Multicast, Serial, TcpIn, TcpOut, UdpIn, UdpOut
from mavlink_bridge.links.opening import open_link
from mavlink_bridge.links.serial_port import SerialPort
from mavlink_bridge.links.stream import Assembler
from mavlink_bridge.links.streams import HUNG, RETRY, StreamLink
from mavlink_bridge.links.tcp import BACKLOG, MOST_CALLERS, TcpCaller, TcpListener
from mavlink_bridge.links.udp import (
    MOST_PEERS,
    REMEMBERED,
    STEADY,
    MulticastLink,
    UdpCaller,
    UdpListener,
)
from mavlink_bridge.messages import Message
from mavlink_bridge.tlog.log import TlogWriter
from mavlink_bridge.wire.codec import Codec
from tests.mavlink_bridge.link_pairs import (
    HOST,
    Terminal,
    frame,
    frames,
    free_port,
    gather,
    meet,
    serial,
    tcp,
    wait,
)

# UDP


def test_a_listener_answers_all_that_it_heard_lately_and_the_last_one_for_ever() -> None:
    clock = SimulatedClock()
    listener = UdpListener(UdpIn(HOST, 0), clock)
    early, late = (UdpCaller(UdpOut(HOST, listener.address[1])) for _ in range(2))
    listener.send(frame(1))
    assert listener.counters == (0, 0, 1)
    early.send(frame(2))
    gather(listener, bool)
    clock.wait_until(REMEMBERED)
    late.send(frame(3))
    gather(listener, bool)
    listener.send(frame(4))
    assert gather(early, bool) == gather(late, bool) == [frame(4)]
    clock.wait_until(REMEMBERED + 1)
    listener.send(frame(5))
    clock.wait_until(5 * REMEMBERED)
    listener.send(frame(6))
    assert gather(late, lambda found: len(found) == 2) == [frame(5), frame(6)]
    assert early.receive() == []
    for link in (listener, early, late):
        link.close()


def test_a_listener_answers_a_bounded_number_of_peers_and_those_that_speak_on_stay() -> None:
    clock = SimulatedClock()
    listener = UdpListener(UdpIn(HOST, 0), clock)
    callers = [UdpCaller(UdpOut(HOST, listener.address[1])) for _ in range(MOST_PEERS + 1)]
    *steady, late = callers
    silent = steady[7]

    def speak(who: Iterable[UdpCaller]) -> None:
        for caller in who:
            caller.send(frame(1))
            assert gather(listener, bool) == [frame(1)]

    speak(steady)
    for _ in range(5):
        clock.wait_until(clock.now() + STEADY // 3)
        speak(caller for caller in steady if caller is not silent)
        if clock.now() <= STEADY:
            # There is no room for one more, however often it speaks.
            speak([late] * 3)
            listener.send(frame(2))
            assert all(gather(caller, bool) == [frame(2)] for caller in steady)
            assert late.receive() == []
    speak([late])
    listener.send(frame(3))
    assert all(gather(caller, bool) == [frame(3)] for caller in callers if caller is not silent)
    assert silent.receive() == []
    for link in (listener, *callers):
        link.close()


def test_a_listener_with_a_peer_speaks_first_and_to_others_too() -> None:
    """As an autopilot's port: its ground station need say nothing, and is never forgotten."""
    clock = SimulatedClock()
    station = UdpListener(UdpIn(HOST, 0), clock)
    listener = UdpListener(UdpIn(HOST, 0, (HOST, station.address[1])), clock)
    listener.send(frame(1))
    assert gather(station, bool) == [frame(1)]
    assert listener.peers == 0
    other = UdpCaller(UdpOut(HOST, listener.address[1]))
    for speaker in (station, other):
        speaker.send(frame(2))
        gather(listener, bool)
    assert listener.peers == 2
    listener.send(frame(3))
    assert gather(station, bool) == gather(other, bool) == [frame(3)]
    clock.wait_until(2 * REMEMBERED)
    assert listener.peers == 0
    listener.send(frame(4))
    assert gather(station, bool) == [frame(4)]
    for link in (listener, station, other):
        link.close()


def test_a_listener_and_its_peer_speak_one_protocol() -> None:
    with pytest.raises(LinkError, match="one is an IPv4 and the other an IPv6 address"):
        open_link("udpin:127.0.0.1:0,[::1]:14550", SimulatedClock())


def test_a_caller_hears_nobody_but_whom_it_called() -> None:
    listener = UdpListener(UdpIn(HOST, 0), SimulatedClock())
    caller = UdpCaller(UdpOut(HOST, listener.address[1]))
    caller.send(frame(1))
    gather(listener, bool)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.sendto(frame(2), caller.address)
    listener.send(frame(3))
    assert gather(caller, bool) == [frame(3)]
    listener.close()
    caller.close()


def test_multicast_reaches_all_others_and_gives_no_echo() -> None:
    endpoint = Multicast(port=free_port(), interface=HOST)
    members = [MulticastLink(endpoint) for _ in range(3)]
    for number, member in enumerate(members):
        member.send(frame(number))
    for number, member in enumerate(members):
        found = gather(member, lambda found: len(found) >= 2)
        assert found == [frame(other) for other in range(3) if other != number]
        assert member.receive() == []
        member.close()


def test_what_else_comes_to_the_port_of_a_group_is_not_for_its_members() -> None:
    endpoint = Multicast(port=free_port(), interface=HOST)
    member, other = MulticastLink(endpoint), MulticastLink(endpoint)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.sendto(frame(1), (HOST, endpoint.port))
    other.send(frame(2))
    member.send(frame(3))
    # Of all sockets at the port the system would choose one for the stranger.
    assert gather(member, bool) == [frame(2)]
    assert gather(other, bool) == [frame(3)]
    member.close()
    other.close()


def test_multicast_on_a_loopback_interface_leaves_no_machine() -> None:
    link = MulticastLink(Multicast(port=free_port(), interface=HOST))
    assert link._sender.getsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL) == 0
    link.close()


# Streams


@given(
    st.lists(
        st.one_of(
            st.integers(0, 2**32 - 1).map(lambda number: frame(number, number % 100)),
            st.binary(max_size=40),
            st.just(b"\xfd\x03\0\0\x01\x0b\x01\xef\xbe\xad" + b"abc" + b"\x12\x34"),  # an unknown message
        ),
        max_size=12,
    ),
    st.lists(st.integers(1, 300), min_size=1, max_size=20),
)
@settings(max_examples=200)
def test_a_stream_put_together_loses_nothing(parts: list[bytes], cuts: list[int]) -> None:
    stream = b"".join(parts)
    assembler, after, plain = Assembler(), Codec(), Codec()
    said: list[Message] = []
    expected: list[Message] = []
    out = b""
    at = turn = 0
    while at < len(stream):
        size = cuts[turn % len(cuts)]
        piece = assembler.feed(stream[at : at + size])
        said += after.feed(piece)
        expected += plain.feed(stream[at : at + size])
        assert said == expected[: len(said)]
        out += piece
        at, turn = at + size, turn + 1
    assert out == stream[: len(out)]
    assert len(stream) - len(out) < 281
    assert said + after.feed(stream[len(out) :]) == expected
    assert after.counters == plain.counters


@given(st.lists(st.integers(0, 120), max_size=20), st.lists(st.integers(1, 300), min_size=1, max_size=20))
def test_a_stream_of_frames_is_cut_between_frames(sizes: list[int], cuts: list[int]) -> None:
    sent = [frame(number, size) for number, size in enumerate(sizes)]
    stream, assembler = b"".join(sent), Assembler()
    ends = [sum(cuts[k % len(cuts)] for k in range(turn)) for turn in range(len(stream) + 1)]
    pieces = [assembler.feed(stream[start:end]) for start, end in pairwise(ends)]
    assert frames(pieces) == sent


def test_a_caller_waits_for_a_listener_and_finds_it_again() -> None:
    clock = SimulatedClock()
    port = free_port()
    caller = TcpCaller(TcpOut(HOST, port), clock)
    caller.send(frame(1))
    assert caller.counters.dropped == 1
    for turn in range(3):
        listener = TcpListener(TcpIn(HOST, port), clock)
        clock.wait_until(clock.now() + RETRY)
        caller.receive()
        # The call from before the listener was there may have to be given up first.
        while not caller.peers:
            wait(caller)
            caller.receive()
            clock.wait_until(clock.now() + RETRY)
        meet(caller, listener)
        caller.send(frame(turn))
        assert gather(listener, bool) == [frame(turn)]
        listener.close()
        while caller.peers:
            wait(caller)
            assert caller.receive() == []
    caller.close()


def test_a_sender_notices_by_itself_that_there_is_room_again() -> None:
    here, there = tcp()
    while not here.counters.dropped:
        here.send(frame(1, 120))
    sent = here.counters.sent
    found = 0
    while found < sent - 1000:
        wait(there)
        found += len(frames(there.receive()))
    here.send(frame(2, 120))
    assert here.counters.sent == sent + 1
    here.close()
    there.close()


def test_everyone_who_has_called_hears_everything() -> None:
    clock = SimulatedClock()
    listener = TcpListener(TcpIn(HOST, 0), clock)
    callers = [TcpCaller(TcpOut(HOST, listener.address[1]), clock) for _ in range(3)]
    while listener.peers < 3 or not all(caller.peers for caller in callers):
        wait(listener, *callers)
        for link in (listener, *callers):
            link.receive()
    listener.send(frame(1))
    assert all(gather(caller, bool) == [frame(1)] for caller in callers)
    callers[0].close()
    while listener.peers == 3:
        wait(listener)
        assert listener.receive() == []
    listener.send(frame(2))
    assert all(gather(caller, bool) == [frame(2)] for caller in callers[1:])
    for link in (listener, *callers):
        link.close()


def test_who_calls_and_never_reads_costs_nobody_else_anything_and_is_given_up() -> None:
    clock = SimulatedClock()
    listener = TcpListener(TcpIn(HOST, 0), clock)
    sleeper = socket.create_connection(listener.address)
    reader = TcpCaller(TcpOut(HOST, listener.address[1]), clock)
    meet(reader, listener)
    while listener.peers < 2:
        wait(listener)
        listener.receive()
    number = received = 0
    while listener.peers == 2:
        # Some seconds of a busy vehicle from one second to the next.
        clock.wait_until(clock.now() + 1_000_000)
        for _ in range(20):
            listener.send(frame(number, 120) * 8)
            number += 1
            received += len(frames(gather(reader, bool)))
        assert all(len(stream._waiting) <= BACKLOG for stream in listener._streams)
    assert clock.now() > HUNG
    assert listener.counters.dropped == 0
    while received < 8 * number:
        received += len(frames(gather(reader, bool)))
    assert received == 8 * number
    for one in (sleeper, reader, listener):
        one.close()


def test_who_takes_a_little_now_and_then_is_not_given_up() -> None:
    clock = SimulatedClock()
    listener = TcpListener(TcpIn(HOST, 0), clock)
    slow = socket.create_connection(listener.address)
    while not listener.peers:
        wait(listener)
        listener.receive()
    while not listener.counters.dropped:
        listener.send(frame(1, 120) * 8)
    for _ in range(5):
        clock.wait_until(clock.now() + HUNG - 1)
        sent = listener.counters.sent
        while listener.counters.sent == sent:
            slow.recv(1 << 16)
            listener.send(frame(2, 120))
        while listener.counters.sent > sent:
            sent = listener.counters.sent
            listener.send(frame(3, 120))
        assert listener.peers == 1
    slow.close()
    listener.close()


def test_callers_that_vanish_leave_room_for_others() -> None:
    """More than there are places for, one after the other and many at once."""
    listener = TcpListener(TcpIn(HOST, 0), SimulatedClock())
    for _ in range(3):
        crowd = [socket.create_connection(listener.address) for _ in range(MOST_CALLERS + 5)]
        while listener.peers < MOST_CALLERS:
            wait(listener)
            listener.receive()
        for caller in crowd:
            caller.send(frame(1)[:-3])
            caller.close()
        while listener.peers:
            listener.send(frame(2))
            listener.receive()
    assert len(listener._selector.get_map()) == 1
    listener.close()


def test_frames_of_two_callers_are_not_mixed_however_they_are_cut() -> None:
    clock = SimulatedClock()
    listener = TcpListener(TcpIn(HOST, 0), clock)
    with socket.create_connection(listener.address) as one, socket.create_connection(listener.address) as two:
        found: list[bytes] = []
        whole = [frame(1, 90), frame(2, 90)]
        for start in range(0, len(whole[0]), 10):
            for caller, data in zip((one, two), whole, strict=True):
                caller.sendall(data[start : start + 10])
            wait(listener)
            found += listener.receive()
        found += gather(listener, lambda more: len(found) + len(more) == 2)
    assert sorted(frames(found)) == sorted(whole)
    listener.close()


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


# Logs

EPOCH = 1_700_000_000_000_000


def write_log(path: Path, offsets: list[int]) -> str:
    with TlogWriter(path) as writer:
        for number, offset in enumerate(offsets):
            writer.write(EPOCH + offset, number % 4, frame(number))
    return f"tlog:{path}"


@given(st.lists(st.integers(0, 10**7), min_size=1, max_size=30), st.lists(st.integers(0, 10**6), max_size=30))
@settings(max_examples=40)
def test_a_log_arrives_at_its_times(
    tmp_path_factory: pytest.TempPathFactory, offsets: list[int], waits: list[int]
) -> None:
    clock = SimulatedClock(5_000)
    link = open_link(write_log(tmp_path_factory.mktemp("log") / "a.tlog", offsets), clock)
    assert link.fileno() is None
    times = [offset & ~3 for offset in offsets]
    latest = [max(times[: k + 1]) - times[0] for k in range(len(times))]
    found: list[bytes] = []
    for pause in [0, *waits, 10**8]:
        clock.wait_until(clock.now() + pause)
        found += link.receive()
        assert len(found) == sum(time <= clock.now() - 5_000 for time in latest)
    assert found == [frame(number) for number in range(len(offsets))]
    link.send(frame(1))
    assert link.counters == (len(offsets), 0, 1)
    link.close()


def test_a_closed_log_says_nothing_more(tmp_path: Path) -> None:
    clock = SimulatedClock()
    link = open_link(write_log(tmp_path / "a.tlog", [0, 1000, 2000]), clock)
    assert link.receive() == [frame(0)]
    link.close()
    clock.wait_until(10_000)
    assert link.receive() == []
    link.close()


# Refusals


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("udpin:192.0.2.1:14550", "cannot listen there"),
        ("tcpin:192.0.2.1:14550", "cannot listen there"),
        ("udpin:no.such.host.invalid:14550", "has no address"),
        ("tcp:a..b:14550", "has no address"),
        ("udpout:255.255.255.255:14550", "use mcast: to reach several"),
        ("mcast:239.1.1.1:14550,192.0.2.1", "cannot join"),
        ("/dev/no-such-port,57600", "No such file"),
        (f"{os.devnull},57600", "not a serial port"),
        ("tlog:/no/such/log.tlog", "cannot be read"),
    ],
)
def test_what_cannot_be_opened_is_said_in_one_line_and_leaves_nothing_open(text: str, said: str) -> None:
    gc.collect()
    before = set(os.listdir("/dev/fd"))
    with pytest.raises(BridgeError) as caught:
        open_link(text, SimulatedClock())
    assert set(os.listdir("/dev/fd")) == before
    message = str(caught.value)
    assert said in message
    assert text.partition(":")[2] in message
    assert "\n" not in message


@pytest.mark.parametrize("kind", [UdpIn, TcpIn])
def test_a_port_has_one_listener(kind: type[UdpIn] | type[TcpIn]) -> None:
    first = open_link(kind(HOST, 0), SimulatedClock())
    assert isinstance(first, UdpListener | TcpListener)
    with pytest.raises(LinkError, match="in use"):
        open_link(kind(HOST, first.address[1]), SimulatedClock())
    first.close()


def test_a_speed_that_the_system_does_not_know_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    termios = pytest.importorskip("termios")
    monkeypatch.delattr(termios, f"B{BAUD_RATES[-1]}", raising=False)
    with pytest.raises(LinkError, match="knows no 4000000 baud"):
        open_link(Serial("/dev/null", BAUD_RATES[-1]), SimulatedClock())
