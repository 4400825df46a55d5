"""Laws of the examination: whatever is on the link there is a verdict, and what does not matter does not
change it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from random import Random
from struct import pack
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import (
    BY_ID,
    Attitude,
    GlobalPosition,
    GpsGlobalOrigin,
    GpsRaw,
    Heartbeat,
    LocalPosition,
    Message,
    ParamValue,
    Source,
    StatusText,
    SysStatus,
)
from mavlink_bridge.tlog.log import TlogReader
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.framing import CRC_EXTRA, frame_v1, frame_v2, leading_frames
from mavlink_bridge.wire.param_value import number_of
from outrider.doctor.boot_clock import BootClock
from outrider.doctor.consultation import Consultation
from outrider.doctor.examination import Examination
from outrider.doctor.finding import Severity, Verdict
from outrider.doctor.hearing import MOST
from outrider.doctor.page import document, show
from outrider.doctor.questions import COMPONENT
from tests.outrider.doctor.bench import TICK, Bench, autopilot, blocking, found, warnings

PIECES = sorted((Path(__file__).parents[2] / "data" / "doctor").glob("*.tlog.gz"))
ME = Source(1, 1)
BEATS = [Heartbeat(ME, 2, autopilot, 0x81, 4, 4) for autopilot in (3, 12, 0, 8)]
SYSTEMS = st.sampled_from([0, 1, 1, 1, 2, 255])
COMPONENTS = st.sampled_from([1, 1, 1, 0, 195, 190, COMPONENT])


@st.composite
def frames(draw: st.DrawFn) -> bytes:
    """Any payload of any message that is read, or of one that is not, from few senders."""
    number = draw(st.sampled_from([*BY_ID, 0, 1, 22, 24, 32, 33, 49, 84, 193, 230, 242, 253, 66, 65]))
    source = draw(SYSTEMS), draw(COMPONENTS)
    payload = draw(st.binary(max_size=60))
    make = frame_v2 if number > 255 or draw(st.booleans()) else frame_v1
    return make(number, CRC_EXTRA[number], source, draw(st.integers(0, 255)), payload)


def sound(verdict: Verdict) -> None:
    value = document(verdict)
    json.dumps(value)
    assert value["ready"] is not any(finding["severity"] == "blocking" for finding in value["findings"])
    assert verdict.findings
    for finding in verdict.findings:
        assert finding.what
        assert finding.why
        assert finding.do or finding.severity in (Severity.OK, Severity.NOTE)


def received(
    records: Sequence[tuple[int, Message]], *, log: bool = True, system: int | None = None
) -> Examination:
    """An examination of messages and their times (µs)."""
    codec, examination = Codec(), Examination(system, log=log)
    for now, message in records:
        for frame in leading_frames(codec.encode(message))[0]:
            examination.hearing.receive(now, frame)
    return examination


@settings(max_examples=150, deadline=None)
@given(
    st.lists(st.tuples(st.integers(-(2**40), 2**50), frames()), max_size=40),
    st.sampled_from(BEATS),
    st.booleans(),
    st.none() | st.integers(1, 255),
)
def test_whatever_is_in_it_there_is_a_verdict(
    records: list[tuple[int, bytes]], beat: Heartbeat, log: bool, system: int | None
) -> None:
    examination = Examination(system, log=log)
    for now, data in [(0, Codec().encode(beat)), *records]:
        for frame in leading_frames(data)[0]:
            examination.hearing.receive(now, frame)
        if now % 7 == 0:
            sound(examination.verdict())
    sound(examination.verdict())


@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.binary(max_size=120) | frames() | st.sampled_from([Codec().encode(beat) for beat in BEATS]),
        max_size=60,
    )
)
def test_whatever_arrives_it_asks_nothing_but_what_is_harmless(arriving: list[bytes]) -> None:
    consultation, codec = Consultation(3_000_000), Codec()
    now, said = 0, []
    while not consultation.over(now):
        data = arriving[now // TICK : now // TICK + 1]
        for sent in consultation.step(now, data):
            said += codec.feed(sent)
        now += TICK
    assert now <= 3_000_000
    sound(consultation.examination.verdict())
    kinds = {type(message).__name__ for message in said}
    assert kinds <= {"Heartbeat", "CommandLong", "ParamRequestRead"}
    assert {getattr(message, "command", 512) for message in said} == {512}


def test_a_flood_of_senders_is_bounded() -> None:
    records = [(k, Heartbeat(Source(1 + k % 250, k // 250 % 250), 2, 3, 0, 0, 3)) for k in range(1000)]
    examination = received(records)
    assert len(examination.hearing.senders) == MOST
    assert found(examination.verdict(), f"more than {MOST} senders").severity is Severity.WARNING


def test_copies_of_frames_change_nothing_but_that_they_are_told() -> None:
    vehicle = Bench(autopilot("px4"))
    told = [(k * TICK, data) for k in range(600) for data in vehicle.tick()]
    once, twice = Examination(log=True), Examination(log=True)
    for now, data in told:
        for frame in leading_frames(data)[0]:
            once.hearing.receive(now, frame)
            twice.hearing.receive(now, frame)
            twice.hearing.receive(now, frame)
    extra = set(twice.verdict().findings) - set(once.verdict().findings)
    assert {finding.what.partition(" ")[2] for finding in extra} == {"frames came twice"}
    assert set(once.verdict().findings) <= set(twice.verdict().findings)


BEAT = Heartbeat(ME, 2, 3, 0, 0, 3)
PLACE = 47.3977, 8.5456, 488.0
ORIGIN = GpsGlobalOrigin(ME, *PLACE, 0)


POOR = GpsRaw(ME, 0, 3, *PLACE, 4.0, 1.0, 0.0, 0.0, 6, 0.0, 0.0, 0.0, 0.0)


def status(present: int, remaining: float | None) -> SysStatus:
    """Of which nothing but the pre-arm check is healthy."""
    return SysStatus(ME, present, present, mavlink.MAV_SYS_STATUS_PREARM_CHECK, 12.0, remaining)


def positions(north: float, vz_up: bool = False) -> list[tuple[int, Message]]:
    """30 s up and down by 3 m; the local frame says that it is ``north`` m from where the globe does."""
    said: list[tuple[int, Message]] = [(0, BEAT), (0, ORIGIN)]
    for k in range(1, 300):
        now = k * 100_000
        height, climb = 5.0 + 3.0 * np.sin(now * 1e-6), 3.0 * np.cos(now * 1e-6)
        vz = climb if vz_up else -climb
        said.append(
            (
                now,
                GlobalPosition(ME, now, PLACE[0], PLACE[1], PLACE[2] + height, height, (0.0, 0.0, vz), None),
            )
        )
        said.append((now, LocalPosition(ME, now, (north, 0.0, -height), (0.0, 0.0, -climb))))
    return said


@pytest.mark.parametrize(("north", "right"), [(0.0, True), (1.0, True), (10.0, False), (-500.0, False)])
def test_positions_have_to_agree(north: float, right: bool) -> None:
    verdict = received(positions(north)).verdict()
    finding = found(verdict, "local and global position")
    assert finding.severity is (Severity.OK if right else Severity.BLOCKING)
    assert f"{abs(north):.1f} m" in finding.what


@pytest.mark.parametrize("up", [False, True])
def test_the_sign_of_vz(up: bool) -> None:
    assert (
        "GLOBAL_POSITION_INT says vz positive when it climbs"
        in warnings(received(positions(0.0, up)).verdict())
    ) is up


def test_an_origin_that_moves() -> None:
    moved = GpsGlobalOrigin(ME, PLACE[0] + 1e-4, PLACE[1], PLACE[2], 0)
    verdict = received([*positions(0.0), (30_000_000, moved)]).verdict()
    assert found(verdict, "the origin has moved, by 11.1 m").severity is Severity.WARNING


@pytest.mark.parametrize("speed", [0.98, 1.0, 5.0, 10.0])
@pytest.mark.parametrize("restart", [0, 20])
def test_a_clock_that_runs_at_some_speed(speed: float, restart: int) -> None:
    clock = BootClock()
    for second in range(60):
        boot = round((second - (restart if second >= restart else 0)) * speed * 1e6) + 1_000_000
        for kind in (
            Attitude(ME, boot, 0.0, 0.0, 0.0, (0.0, 0.0, 0.0)),
            LocalPosition(ME, boot, (0.0,) * 3, (0.0,) * 3),
        ):
            clock.tell(second * 1_000_000, kind, boot)
    assert clock.rate == pytest.approx(speed)
    assert (clock.restarts, clock.doubled) == (1 if restart else 0, False)
    assert clock.leaps == 0


@pytest.mark.parametrize(
    ("kind", "value", "raw", "bytewise"),
    [
        (6, 5.0, pack("<i", 5), True),
        (6, 5.0, pack("<f", 5.0), False),
        (9, 0.5, pack("<f", 0.5), True),
        (2, -3.0, b"\xfd\0\0\0", True),
    ],
)
def test_a_parameter_is_what_its_firmware_means(kind: int, value: float, raw: bytes, bytewise: bool) -> None:
    assert number_of(ParamValue(ME, raw, 1, 0, "X", kind), bytewise=bytewise) == value
    assert number_of(ParamValue(ME, pack("<f", float("nan")), 1, 0, "X", 9), bytewise=bytewise) is None


@pytest.mark.parametrize(
    ("said", "words", "severity"),
    [
        (Heartbeat(ME, 1, 3, 0, 0, 3), "fixed wing: no multicopter", Severity.BLOCKING),
        (Heartbeat(ME, 2, 0, 0, 0, 3), "an autopilot that is not known: generic (0)", Severity.BLOCKING),
        (Heartbeat(ME, 2, 3, 0, 0, 2), "it is still starting", Severity.BLOCKING),
        (Heartbeat(ME, 2, 3, 0x80, 4, 5), "its state is critical", Severity.BLOCKING),
        (status(0x10000001, 0.9), "unhealthy: 3d gyro", Severity.WARNING),
        (status(0x10010000, 0.9), "unhealthy: rc receiver", Severity.NOTE),
        (status(mavlink.MAV_SYS_STATUS_PREARM_CHECK, 0.25), "battery: 25%", Severity.WARNING),
        (status(mavlink.MAV_SYS_STATUS_PREARM_CHECK, None), "charge is not told, 12.0 V", Severity.NOTE),
        (POOR, "GPS: 3D fix, 6 satellites, poor", Severity.WARNING),
        (Heartbeat(Source(0, 1), 2, 3, 0, 0, 3), "the vehicle's system id is 0", Severity.BLOCKING),
        (GpsGlobalOrigin(ME, 0.0, 0.0, 0.0, 0), "the origin is at 0°, 0°", Severity.BLOCKING),
    ],
)  # fmt: skip
def test_what_is_said_of_it(said: Message, words: str, severity: Severity) -> None:
    first = BEAT._replace(source=said.source)
    verdict = received([(0, first), (10, said), (1_000_000, said)]).verdict()
    assert found(verdict, words).severity is severity


def test_the_autopilots_own_words_say_why_it_does_not_arm() -> None:
    texts: list[Any] = [
        StatusText(ME, 3, f"PreArm: {why}") for why in ("Compass not healthy", "RC not found")
    ] * 3
    status = SysStatus(ME, 0x10000000, 0x10000000, 0, 12.0, 0.9)
    verdict = received([(0, BEAT), *enumerate(texts), (9, status)]).verdict()
    assert (
        "PreArm: Compass not healthy; PreArm: RC not found." in found(verdict, "the pre-arm check fails").why
    )


def test_words_that_would_steer_a_terminal_do_not(capsys: pytest.CaptureFixture[str]) -> None:
    text = StatusText(ME, 3, "PreArm: \x1b[2Jgone")
    status = SysStatus(ME, 0x10000000, 0x10000000, 0, 12.0, 0.9)
    show("it", received([(0, BEAT), (1, text), (2, status)]).verdict())
    assert "\x1b" not in capsys.readouterr().out


def test_nothing_but_bytes() -> None:
    consultation = Consultation(2_000_000)
    now = 0
    while not consultation.over(now):
        consultation.step(now, [bytes(range(200))])
        now += TICK
    (what,) = blocking(consultation.examination.verdict())
    assert "bytes arrive, and no MAVLink among them" in what


@settings(max_examples=25, deadline=None)
@given(st.sampled_from(PIECES), st.integers(0, 2**32), st.booleans())
def test_whatever_happens_to_a_recorded_log(piece: Path, seed: int, log: bool) -> None:
    chance = Random(seed)
    records = list(TlogReader(piece))
    first = chance.randrange(len(records))
    examination = Examination(log=log)
    for time, _, data in records[first : first + 500]:
        (frame,) = leading_frames(data)[0]
        if chance.random() < 0.3:
            payload = bytearray(frame.payload.ljust(30, b"\0"))
            payload[chance.randrange(len(payload))] = chance.choice((0, 127, 128, 255))
            number = chance.choice((frame.message_id, 0, 1, 22, 24, 32, 33, 49, 148, 193, 230, 242))
            source = chance.choice((0, 3, frame.system)), frame.component
            data = frame_v2(number, CRC_EXTRA[number], source, frame.sequence, bytes(payload))
            (frame,) = leading_frames(data)[0]
        examination.hearing.receive(time + chance.choice((0, 0, 0, -10_000_000, 100_000_000)), frame)
    sound(examination.verdict())
