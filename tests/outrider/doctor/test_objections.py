"""A pre-arm check that fails: the doctor asks why, listens until the answer has come, and names it."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import CommandLong, Heartbeat, Message, Source, StatusText, SysStatus
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.framing import Frame, Framer, frame_at, frame_v2, leading_frames
from outrider.doctor.consultation import Consultation
from outrider.doctor.finding import Severity, Verdict
from outrider.doctor.objections import Objections
from outrider.doctor.px4_events import CRC_EXTRA, EVENT, LAYOUT, event_id, reason
from outrider.doctor.sender_record import SenderRecord
from tests.outrider.doctor.bench import TICK, Bench, autopilot, found
from tests.sitl.autopilot_rig import FLAVOURS, SET_MODE

ME, DOCTOR = Source(11, 1), Source(11, 193)
FAILING = SysStatus(ME, 0x10000000, 0x10000000, 0, 12.0, 0.9)
PASSING = FAILING._replace(health=0x10000000)
HOLD, OFFBOARD = 4 << 16 | 3 << 24, 6 << 16
ALL_MODES, MANUAL_ONLY = 0xFFFFFFFF, 0b111
FAILS = "the pre-arm check fails"


def empty(flavour: str, passes: Callable[[Frame], bool] = lambda _frame: True) -> Bench:
    """A vehicle whose battery is empty."""
    bench = Bench(autopilot(flavour, failures="obeyed"), passes=passes)
    bench.run(3.0)
    bench.order(
        mavlink.MAV_CMD_INJECT_FAILURE, mavlink.FAILURE_UNIT_SYSTEM_BATTERY, mavlink.FAILURE_TYPE_OFF, 0
    )
    bench.run(3.0)
    return bench


def asked(bench: Bench) -> int:
    return sum(
        isinstance(one, CommandLong) and one.command == mavlink.MAV_CMD_RUN_PREARM_CHECKS
        for one in bench.received
    )


def event(name: str, *, modes: int = ALL_MODES, level: int = 3, extra: bytes = CRC_EXTRA) -> bytes:
    """An EVENT of PX4 about an arming check."""
    payload = LAYOUT.pack(1 << 24 | event_id(name), 1000, 7, 0, 0, level, modes)
    return frame_v2(EVENT, extra, ME, 0, payload)


def framed(data: bytes) -> Frame:
    frame = frame_at(data, 0)
    assert isinstance(frame, Frame)
    return frame


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_the_reasons_are_asked_for_and_named(flavour: str) -> None:
    bench = empty(flavour)
    bench.order(mavlink.MAV_CMD_INJECT_FAILURE, mavlink.FAILURE_UNIT_SENSOR_GPS, mavlink.FAILURE_TYPE_OFF, 0)
    bench.run(15.0)
    # What it said by itself is gone by now: only who asks hears it.
    start = bench.now
    verdict = bench.consult()
    prefix = {"ardupilot": "PreArm", "px4": "Preflight Fail"}[flavour]
    finding = found(verdict, FAILS)
    assert finding.severity is Severity.BLOCKING
    assert f"It said: {prefix}: no position yet; {prefix}: battery empty." in finding.why
    assert asked(bench) == 1
    assert bench.now - start < 10_000_000


def test_it_listens_longer_than_its_limit_for_texts_that_come_every_30_s() -> None:
    bench = empty(
        "ardupilot",
        lambda frame: frame.message_id != mavlink.MAVLINK_MSG_ID_STATUSTEXT or bench.now > 24_000_000,
    )
    verdict = bench.consult(seconds=10.0)
    assert "It said: PreArm: battery empty." in found(verdict, FAILS).why
    assert 24_000_000 < bench.now < 44_000_000


@pytest.mark.parametrize(
    ("flavour", "words", "longest"), [("ardupilot", "ARMING_OPTIONS", 45e6), ("px4", "QGroundControl", 16e6)]
)
def test_one_that_names_no_reason_is_asked_three_times_at_most(
    flavour: str, words: str, longest: float
) -> None:
    bench = empty(flavour, lambda frame: frame.message_id != mavlink.MAVLINK_MSG_ID_STATUSTEXT)
    start = bench.now
    verdict = bench.consult(seconds=8.0)
    finding = found(verdict, FAILS)
    assert "named no" in finding.why
    assert words in finding.do
    assert 1 <= asked(bench) <= 3
    assert bench.now - start < longest


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_one_that_may_be_armed_is_not_asked(flavour: str) -> None:
    bench = Bench(autopilot(flavour))
    bench.run(3.0)
    assert bench.consult().ready
    assert asked(bench) == 0


def test_who_is_armed_or_passes_is_neither_asked_nor_waited_for() -> None:
    codec = Codec()

    def left(*said: Message) -> tuple[int, int]:
        vehicle, objections = SenderRecord(ME), Objections()
        for now, message in enumerate(said):
            vehicle.tell(now, framed(codec.encode(message)), message)
        return len(objections.due(vehicle, DOCTOR, 10)), objections.left(vehicle, 10)

    beat = Heartbeat(ME, 2, 3, 0, 4, 3)
    assert left(beat, FAILING) == (1, 35_000_000)
    assert left(beat, PASSING) == left(beat) == (0, 0)
    assert left(beat._replace(base_mode=0x80), FAILING) == (0, 0)


def test_progress_says_what_it_waits_for_and_goes_from_0_to_1() -> None:
    bench = empty("ardupilot")
    consultation = Consultation(6_000_000)
    now, shares, words, mail = 0, [0.0], set(), list[Message]()
    while not consultation.over(now):
        told = [
            frame.data
            for data in bench.tick(*mail)
            for frame in leading_frames(data)[0]
            if frame.message_id != mavlink.MAVLINK_MSG_ID_STATUSTEXT
        ]
        mail = [message for data in consultation.step(now, told) for message in Codec().feed(data)]
        shares.append(consultation.share(now))
        words.add(consultation.doing(now).split(",")[0])
        now += TICK
    assert words >= {"asking why the pre-arm check fails", "listening and asking"}
    assert all(0.0 <= share <= 1.0 for share in shares)
    assert shares[-1] > 0.95
    assert 35_000_000 <= now < 45_000_000


# PX4's events


def test_events_are_known_by_the_hash_of_their_names() -> None:
    # The low 24 bits of FNV-1a's published values.
    assert (event_id("a"), event_id("foobar")) == (0x0C292C, 0x9CF968)


@pytest.mark.parametrize("stream", [False, True])
def test_px4_without_a_ground_station_says_it_by_events(stream: bool) -> None:
    """PX4 sends STATUSTEXT only where it hears a ground station."""
    said = [
        event("check_mag_not_calibrated"),
        event("check_modes_manual_control", modes=MANUAL_ONLY),  # not in HOLD
        event("check_rc_dl_no_dllink", level=6),  # an information
        event("check_gyro_missing", extra=b"\x00"),  # damaged
        event("some_other_event"),
    ]
    beat = Codec().encode(Heartbeat(Source(11, 190), 6, 8, 0, 0, 4))
    told = [b"".join([*said, beat])] if stream else [*said, beat]
    verdict = px4_saying(told)
    assert "It said: a compass is not calibrated." in found(verdict, FAILS).why


def px4_saying(told: list[bytes], mode: int = HOLD, health: int = 0) -> Verdict:
    """Of a PX4 that says its state again and again, and ``told`` when it is asked for its reasons."""
    consultation, codec = Consultation(10_000_000), Codec()
    now = 0
    while not consultation.over(now):
        arrived = []
        if now % 500_000 == 0:
            beat = Heartbeat(ME, 2, 12, 0x1, mode, 3)
            arrived = [codec.encode(beat), codec.encode(FAILING._replace(health=health))]
        out = [message for data in consultation.step(now, arrived) for message in Codec().feed(data)]
        if any(
            isinstance(one, CommandLong) and one.command == mavlink.MAV_CMD_RUN_PREARM_CHECKS for one in out
        ):
            consultation.step(now, told)
        now += TICK
    return consultation.examination.verdict()


@given(payload=st.binary(max_size=53), mode=st.integers(0, 0xFFFFFFFF), signed=st.booleans())
def test_whatever_an_event_holds_it_is_read_or_left(payload: bytes, mode: int, signed: bool) -> None:
    frame = framed(frame_v2(EVENT, CRC_EXTRA, ME, 0, payload))
    found = reason(frame._replace(signed=signed), mode)
    assert found is None or found
    (again,) = Framer(unknown=True).feed(frame.data, whole=True) or (frame,)
    assert again.data == frame.data


# The mode


def test_a_disarmed_px4_in_offboard_is_named_with_what_to_do() -> None:
    verdict = px4_saying([event("check_modes_offboard_signal", modes=1 << 14)], OFFBOARD)
    finding = found(verdict, "mode OFFBOARD, disarmed")
    assert finding.severity is Severity.BLOCKING
    assert "without" not in finding.do
    assert "Switch it to HOLD" in finding.do
    assert "no offboard signal" in found(verdict, FAILS).why
    # With somebody's set-points the check passes; then it can be armed, and is still not as it should be.
    assert found(px4_saying([], OFFBOARD, 0x10000000), "mode OFFBOARD").severity is Severity.WARNING
    assert found(px4_saying([], HOLD, 0x10000000), "mode AUTO HOLD").severity is Severity.OK


def test_the_emulated_px4_in_offboard_is_named_too() -> None:
    bench = Bench(autopilot("px4"))
    bench.run(3.0)
    bench.order(SET_MODE, 1, 6, 0)
    bench.run(2.0)
    finding = found(bench.consult(), "mode OFFBOARD, disarmed")
    assert finding.severity in (Severity.WARNING, Severity.BLOCKING)
    assert "HOLD" in finding.do


def test_an_objection_that_is_not_repeated_counts_no_more() -> None:
    vehicle, codec = SenderRecord(ME), Codec()
    for seconds, why in (
        (1, "RC not found"),
        (1, "Compass not healthy"),
        (31, "RC not found"),
        (61, "RC not found"),
    ):
        text = StatusText(ME, 2, f"PreArm: {why}\t")
        vehicle.tell(seconds * 1_000_000, framed(codec.encode(text)), text)
    assert vehicle.objections == ["PreArm: RC not found"]
