"""Vehicles of ``outrider sitl`` under a simulated clock: each hears its own link, all show what they are, and
what they keep comes back."""

from __future__ import annotations

import io
import os
import re
import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from mavlink_bridge.key import create_key
from mavlink_bridge.messages import (
    CameraFovStatus,
    CameraTrackingGeo,
    CommandLong,
    Heartbeat,
    HilState,
    Message,
    ParamSet,
    Source,
    StatusText,
    Timesync,
)
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.framing import Framer
from mavlink_bridge.wire.signing import EPOCH, Signing
from outrider.errors import InputError, OutriderError
from outrider.simulation.targets import Walking
from outrider.sitl_server.addresses import addresses
from outrider.sitl_server.display import watching
from outrider.sitl_server.event_feed import EventFeed
from outrider.sitl_server.figures import factor
from outrider.sitl_server.persistence import Persistence, prepare
from outrider.sitl_server.request import Options, Request, checked
from outrider.sitl_server.screen import Screen
from outrider.sitl_server.shared_page import MAX_TEXTS, Pace, SharedPage, VehicleSnapshot
from outrider.sitl_server.traffic import Traffic
from outrider.sitl_server.vehicle_group import SPREAD, VehicleGroup, boot_times
from sitl.values.camera import TrackedObject

GCS = Source(255, 190)
PERIOD = 20_000


class Field:
    """A squad and its board, and someone who speaks to its vehicles."""

    def __init__(self, asked: Request, indices: Sequence[int], state: Path | None = None) -> None:
        self.persistence = Persistence(state, asked.flavour)
        boots = boot_times(indices, asked.speed, PERIOD)
        vehicles = {
            index: asked.autopilot(index, 0, self.persistence.saved(asked.systems[index]))
            for index in indices
        }
        self.board = SharedPage(asked.count, 1)
        self.group = VehicleGroup(vehicles, boots, asked.first_id, self.board, asked.speed, asked.target())
        self.now = 0
        self._codec = Codec()

    def run(self, seconds: float, said: dict[int, list[Message]] | None = None) -> dict[str, list[Message]]:
        """What each link carried out; ``said``: to whom, by index, at the beginning."""
        inbox = [
            Datagram(str(index), self._codec.encode(one))
            for index, messages in (said or {}).items()
            for one in messages
        ]
        heard: dict[str, list[Message]] = {}
        end = self.now + round(seconds * 1e6)
        while self.now < end:
            for link, data in self.group.step(self.now, inbox):
                heard.setdefault(link, []).extend(Codec().feed(data))
            self.group.show(self.now, lambda _link: 1)
            inbox = []
            self.now += PERIOD
        return heard


def arming(system: int) -> CommandLong:
    return CommandLong(GCS, system, 1, 400, 0, (1.0, 21196.0, 0.0, 0.0, 0.0, 0.0, 0.0))


def asked(**options: object) -> Request:
    return checked(Options(**options))  # type: ignore[arg-type]


def test_a_vehicle_hears_its_own_link_and_speaks_on_it() -> None:
    field = Field(asked(count=5, first_id=11), [1, 3, 4])
    heard = field.run(2.0)
    assert {link: {one.source.system for one in found} for link, found in heard.items()} == {
        "1": {12},
        "3": {14},
        "4": {15},
    }
    # To all of a link's listeners; but only one listens there.
    heard = field.run(0.5, {3: [Timesync(GCS, 0, 77)]})
    assert [any(isinstance(one, Timesync) for one in heard[link]) for link in ("1", "3", "4")] == [
        False,
        True,
        False,
    ]
    field.run(1.0, {4: [arming(14), arming(15)]})
    assert [field.board.snapshot(index).armed for index in range(5)] == [False] * 4 + [True]
    assert [field.board.snapshot(index).up for index in range(5)] == [False, True, False, True, True]


def test_what_is_shown_is_so() -> None:
    request = asked(count=4, flavour="px4", spacing=5.0)
    field = Field(request, range(4))
    early = field.run(0.5)
    heard = field.run(1.5, {2: [Heartbeat(GCS, 6, 8, 0, 0, 4)] * 3})
    for index in range(4):
        snapshot, node = field.board.snapshot(index), field.group.slots[index].node
        assert snapshot.position == pytest.approx(request.place(index), abs=0.5)
        assert np.linalg.norm(snapshot.velocity) < 0.1
        assert snapshot.custom_mode == node.custom_mode
        assert snapshot.battery == pytest.approx(node.charge, abs=1e-3)
        assert snapshot.clients == 1
        assert snapshot.received == (3 if index == 2 else 0)
        # It was looked at a fifth of a second ago at most.
        every = len(early[str(index)]) + len(heard[str(index)])
        assert every * 0.8 <= snapshot.sent <= every
        assert 2.0 - SPREAD * 1e-6 - 0.4 <= snapshot.time <= 2.0


def test_vehicles_do_not_all_speak_at_once() -> None:
    field = Field(asked(count=8), range(8))
    first: dict[str, int] = {}
    while len(first) < 8:
        for link, _ in field.group.step(field.now, []):
            first.setdefault(link, field.now)
        field.now += PERIOD
    assert len(set(first.values())) == 8
    assert max(first.values()) <= SPREAD + PERIOD


def test_a_vehicle_that_fails_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    field = Field(asked(count=2, first_id=40), range(2))

    def fail(now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        raise ZeroDivisionError("of what")

    monkeypatch.setattr(field.group.slots[1].node, "step", fail)
    with pytest.raises(OutriderError, match=r"^vehicle 41: ZeroDivisionError: of what$"):
        field.run(1.0)


def test_with_a_key_only_who_has_it_is_obeyed(tmp_path: Path) -> None:
    path = tmp_path / "fleet.key"
    key = create_key(path)
    field = Field(asked(count=2, signing_key=path), range(2), tmp_path / "kept")
    (tmp_path / "kept").mkdir()
    field.run(2.0, {0: [arming(1)], 1: [arming(2)]})
    signing = Signing(key)
    signing.present(EPOCH + 60_000_000)
    order = Codec(signing=signing).encode(arming(2))
    for _, data in field.group.step(field.now, [Datagram("0", order), Datagram("1", order)]):
        assert all(frame.signed for frame in Framer().feed(data))
    field.now += PERIOD
    field.run(0.5)
    assert [field.board.snapshot(index).armed for index in range(2)] == [False, True]
    # Its newest stamp changes all the time, and is written when all ends.
    field.persistence.keep(field.group)
    assert not any((tmp_path / "kept").iterdir())
    field.persistence.keep(field.group, ending=True)
    assert len([*(tmp_path / "kept").iterdir()]) == 2


# Kept over a restart


def test_parameters_come_back_to_the_vehicle_that_kept_them(tmp_path: Path) -> None:
    request, state = asked(count=2, first_id=5), tmp_path / "kept"
    prepare(state, request.flavour, request.systems)
    field = Field(request, range(2), state)
    field.run(0.5)
    value = np.float32(321.0).tobytes()
    field.run(0.5, {1: [ParamSet(GCS, value, 6, 1, "WPNAV_SPEED", 9)]})
    field.persistence.keep(field.group)
    assert [path.name for path in state.iterdir()] == ["ardupilot-6.json"]
    prepare(state, request.flavour, request.systems)
    again = Field(request, range(2), state)
    assert [slot.node.saved for slot in again.group.slots] == [slot.node.saved for slot in field.group.slots]
    assert again.group.slots[1].node.saved.parameters == {"WPNAV_SPEED": 321.0}


@pytest.mark.parametrize("damage", ["", "{", '{"parameters": {"A": "x"}}', '{"other": 1}', "\xff"])
def test_a_damaged_file_is_named_before_anything_starts(damage: str, tmp_path: Path) -> None:
    path = tmp_path / "px4-3.json"
    path.write_bytes(damage.encode("latin-1"))
    prepare(tmp_path, "ardupilot", range(1, 9))
    with pytest.raises(InputError) as caught:
        prepare(tmp_path, "px4", range(1, 9))
    assert str(caught.value).startswith(f"{path}: cannot be used")
    assert "\n" not in str(caught.value)


def test_a_state_that_is_no_directory_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match=r"--state .*file: cannot be made"):
        prepare(tmp_path / "file", "px4", range(1, 2))


def test_without_a_directory_nothing_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    field = Field(asked(), [0])
    field.run(0.2)
    field.persistence.keep(field.group)
    assert not any(tmp_path.iterdir())


# The board

NUMBER = st.floats(-1e6, 1e6)
PLACE = st.tuples(NUMBER, NUMBER, NUMBER)
COUNT = st.integers(0, 2**50)
GAUGES = st.builds(
    VehicleSnapshot,
    st.booleans(),
    st.booleans(),
    st.integers(0, 2**32 - 1),
    PLACE,
    PLACE,
    NUMBER,
    COUNT,
    COUNT,
    COUNT,
    COUNT,
    NUMBER,
)


@given(st.lists(GAUGES, min_size=1, max_size=4), st.lists(st.tuples(NUMBER, NUMBER), min_size=1, max_size=3))
def test_what_is_written_on_the_board_can_be_read_there(
    snapshot: list[VehicleSnapshot], times: list[tuple[float, float]]
) -> None:
    board = SharedPage(len(snapshot), len(times))
    assert not any(board.snapshot(index).up for index in range(len(snapshot)))
    paces = [Pace(*time, 3, 2, 1, 0.5, 1.5, 7) for time in times]
    for index, one in enumerate(snapshot):
        board.show(index, one)
        board.say(index, MAX_TEXTS + index, f"{index} é")
    for group, pace in enumerate(paces):
        board.show_pace(group, pace)
        board.fail(group, "x" * 1000)
    board.stop = True
    assert [board.snapshot(index) for index in range(len(snapshot))] == snapshot
    assert board.paces() == paces
    assert all(board.saying(index, MAX_TEXTS + index) == f"{index} é" for index in range(len(snapshot)))
    assert {len(board.fault(group)) for group in range(len(times))} == {255}
    assert board.stop


def test_the_factor_is_that_of_the_slowest_and_of_late() -> None:
    before = [Pace(10.0, 10.0), Pace(10.0, 10.0)]
    after = [Pace(14.0, 14.0), Pace(12.0, 14.0)]
    assert factor(after, before) == pytest.approx(0.5)
    assert factor(after) == pytest.approx(12.0 / 14.0)
    assert factor(after, after) == factor(after)
    assert factor([Pace()]) == 0.0


# What passes by


@given(st.lists(st.text(st.characters(min_codepoint=32, max_codepoint=126), min_size=1, max_size=120)))
def test_all_that_is_said_is_heard_and_every_frame_counted(texts: list[str]) -> None:
    # Codecs strip the ends of texts, and pieces are cut there.
    texts = [text.strip() for text in texts if "  " not in text and text.strip()]
    codec, traffic = Codec(), Traffic()
    data = [codec.encode(Heartbeat(Source(1, 1), 2, 3, 0, 0, 4))]
    data += [codec.encode(StatusText(Source(1, 1), 4, text)) for text in texts]
    traffic.send(b"".join(data))
    assert traffic.sayings == texts
    assert traffic.sent == 1 + sum(-(-len(text) // 50) for text in texts)
    traffic.receive(b"".join(data))
    assert traffic.received == traffic.sent


@given(st.binary(max_size=600), st.integers(0, 5))
def test_anything_may_be_received(garbage: bytes, frames: int) -> None:
    traffic = Traffic()
    beat = Codec().encode(Heartbeat(GCS, 6, 8, 0, 0, 4))
    traffic.receive(garbage.replace(b"\xfd", b"").replace(b"\xfe", b"") + beat * frames)
    assert traffic.received == frames
    traffic.receive(garbage)


# Words and pictures


def test_what_happens_is_told_once() -> None:
    request = asked(count=2, first_id=3)
    board = SharedPage(2, 1)
    chronicle = EventFeed(request, board)
    assert chronicle.look() == []
    board.show(1, VehicleSnapshot(up=True, custom_mode=4, time=2.0))
    assert chronicle.look() == []
    for number in range(MAX_TEXTS + 2):
        board.say(1, number, f"text {number}")
    board.show(1, VehicleSnapshot(True, True, 9, clients=2, said=MAX_TEXTS + 2, time=12.5))
    lines = chronicle.look()
    assert [line.split("vehicle 4: ")[1] for line in lines] == [
        *(f"says 'text {number}'" for number in range(2, MAX_TEXTS + 2)),
        "mode LAND",
        "armed",
        "2 clients",
    ]
    assert all("12.5 s" in line for line in lines)
    assert chronicle.look() == []


def test_a_pipe_that_nobody_reads_holds_nobody_up(monkeypatch: pytest.MonkeyPatch) -> None:
    request = asked(count=4)
    board = SharedPage(4, 1)
    near, far = os.pipe()
    os.set_blocking(far, False)
    with suppress(BlockingIOError):
        while True:
            os.write(far, bytes(4096))
    os.set_blocking(far, True)
    with open(far, "w", encoding="utf-8") as full:
        monkeypatch.setattr(sys, "stderr", full)
        with watching(request, addresses("ardupilot", 4, None, "127.0.0.1", ()), board) as look:
            board.show(0, VehicleSnapshot(up=True, armed=True))
            look()
        monkeypatch.undo()
    os.close(near)


@pytest.mark.parametrize(("width", "height", "count"), [(80, 24, 3), (80, 24, 50), (200, 60, 12)])
def test_a_picture_fits_the_terminal(width: int, height: int, count: int) -> None:
    request = asked(count=count, flavour="px4")
    board = SharedPage(count, 1)
    for index in range(count):
        board.show(
            index,
            VehicleSnapshot(
                True, True, 6 << 16, (-123.4, 1234.5, 45.6), (3.0, 4.0, 0.0), 0.87, 99, 9999, 12, 0, 3.0
            ),
        )
    board.show_pace(0, Pace(4.0, 4.0, 400, 1, 1, 4.9))
    shown = io.StringIO()
    console = Console(file=shown, force_terminal=True, width=width, height=height, color_system=None)
    screen = Screen(request, addresses("px4", count, None, "127.0.0.1", ()), board, console)
    with screen.live:
        screen.look()
        drawn = shown.getvalue()
    lines = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", drawn).splitlines()
    assert max(map(len, lines)) <= width
    rows = [line for line in lines if "OFFBOARD" in line]
    assert 3 <= len(rows) <= count
    assert len(lines) <= height
    assert "5.0" in rows[0]
    assert "87%" in rows[0]
    assert "…" not in rows[0]
    assert any("1.00 × real time" in line for line in lines)
    if len(rows) < count:
        assert any(f"and {count - len(rows)} more" in line for line in lines)


def test_cameras_see_the_walker_where_it_is_and_clients_get_no_ground_truth() -> None:
    asked = checked(Options(count=2, first_id=1, camera="walker"))
    assert asked.camera is not None
    exact = asked.camera.camera.model_copy(
        update={"pixel_sigma": 0.0, "false_positives": 0.0, "object": TrackedObject(height_sigma=0.0)}
    )
    asked = replace(asked, camera=asked.camera.model_copy(update={"camera": exact}))
    field = Field(asked, [0, 1])
    target = Walking(asked.camera.target, asked.frame)  # type: ignore[arg-type]
    target.begin(0)
    heard = field.run(5.0)
    assert set(heard) == {"0", "1"}
    for link, messages in heard.items():
        boot = field.group.slots[int(link)].boot
        time, found = 0, 0
        for message in messages:
            assert not isinstance(message, HilState)
            if isinstance(message, CameraFovStatus):
                time = message.time_boot + boot
            elif isinstance(message, CameraTrackingGeo):
                place = asked.frame.to_enu(message.latitude, message.longitude, message.altitude)
                assert np.linalg.norm(place - target.position(time)) < 0.05
                found += 1
        assert found > 20


def test_a_vehicle_without_a_camera_has_none() -> None:
    field = Field(checked(Options()), [0])
    (messages,) = field.run(2.0).values()
    assert {message.source.component for message in messages} == {1}
