"""The doctor beside our own autopilots, in lock-step: what is amiss is found, and nothing is touched."""

from __future__ import annotations

import math
from struct import pack
from typing import Any

import pytest
from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.key import Key
from mavlink_bridge.messages import (
    CommandLong,
    Heartbeat,
    ParamRequestRead,
    ParamSet,
    SetpointLocal,
    Source,
)
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.signing import Signing
from outrider.doctor.finding import Severity
from outrider.doctor.questions import COMPONENT, STRANGER
from outrider.doctor.settings import rules
from sitl.config.autopilot import TelemetryRates
from tests.outrider.doctor.bench import (
    GCS,
    Bench,
    autopilot,
    blocking,
    found,
    warnings,
)
from tests.sitl.autopilot_rig import ARM, FLAVOURS, GUIDED, SET_MODE, TAKEOFF

FOLLOWS = "it follows up to "
"""What the shipped companion asks of it is judged beside the vehicle: ``test_doctor_agility``."""
QUIET = TelemetryRates(**{name: 0.0 for name in TelemetryRates.model_fields if name != "heartbeat"})


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_healthy_vehicle_is_ready(flavour: str) -> None:
    bench = Bench(autopilot(flavour))
    bench.run(3.0)
    verdict = bench.consult()
    assert verdict.ready, blocking(verdict)
    assert not [what for what in warnings(verdict) if not what.startswith(FOLLOWS)]
    version = {
        "ardupilot": "ArduPilot 4.6.3, hexarotor, system 11",
        "px4": "PX4 1.16.1, hexarotor, system 11",
    }
    for words in (
        version[flavour],
        "mode STABILIZE, disarmed, on the ground" if flavour == "ardupilot" else "disarmed, on the ground",
        "the pre-arm check has passed",
        "the estimator has an absolute position",
        "GPS: 3D fix, 12 satellites",
        "battery: 100%",
        "origin: 47.3977420°, 8.5455940°, 488.0 m",
        "home is 0.0 m from the origin",
        "local and global position agree",
        "its clock runs 1.000 times as fast",
    ):
        assert found(verdict, words).severity is Severity.OK
    for rule in rules(px4=flavour == "px4"):
        assert found(verdict, f"{rule.name} = ")


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_it_asks_politely_and_changes_nothing(flavour: str) -> None:
    vehicle = autopilot(flavour)
    bench = Bench(vehicle)
    bench.run(3.0)
    before = vehicle.saved, vehicle.armed, vehicle.custom_mode
    bench.consult()
    assert (vehicle.saved, vehicle.armed, vehicle.custom_mode) == before
    for message in bench.received:
        assert message.source in (STRANGER, Source(11, COMPONENT))
        match message:
            case Heartbeat():
                # No ground station: its loss is what failsafes act upon. No autopilot: it has no mode.
                assert (message.type, message.autopilot, message.base_mode) == (18, 8, 0)
            case CommandLong():
                assert (message.command, message.target_system, message.target_component) == (512, 11, 1)
            case _:
                assert isinstance(message, ParamRequestRead)
                assert (message.target_system, message.target_component) == (11, 1)
    questions = [message for message in bench.received if not isinstance(message, Heartbeat)]
    clock = CommandLong(Source(11, COMPONENT), 11, 1, 512, 0, (2.0, *[0.0] * 6))  # type: ignore[arg-type]
    again = questions.count(clock) - 1
    assert len(questions) - max(again, 0) == len(set(questions))  # all were answered at once
    # PX4 tells its time unasked; of ArduPilot's clock one reading says nothing.
    assert again == {"px4": -1, "ardupilot": 7}[flavour]


def test_streams_are_as_they_were_afterwards() -> None:
    vehicle = autopilot("ardupilot", streams="quiet", rates=QUIET)
    bench = Bench(vehicle)
    bench.run(2.0)
    verdict = bench.consult()
    assert verdict.ready, blocking(verdict)
    for name in ("LOCAL_POSITION_NED", "ATTITUDE", "SYS_STATUS", "EXTENDED_SYS_STATE"):
        finding = found(verdict, f"{name} comes only when asked")
        assert (finding.severity, "fly asks for" in finding.do) == (Severity.NOTE, True)
    received = [message for _ in range(200) for data in bench.tick() for message in Codec().feed(data)]
    assert {type(message) for message in received} == {Heartbeat}


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_without_gps(flavour: str) -> None:
    bench = Bench(autopilot(flavour, failures="obeyed"))
    bench.run(3.0)
    bench.order(mavlink.MAV_CMD_INJECT_FAILURE, mavlink.FAILURE_UNIT_SENSOR_GPS, mavlink.FAILURE_TYPE_OFF, 0)
    bench.run(15.0)
    verdict = bench.consult()
    assert not verdict.ready
    assert found(verdict, "GPS: no fix").severity is Severity.BLOCKING
    assert found(verdict, "the estimator has no absolute position").severity is Severity.BLOCKING
    assert "the pre-arm check fails (SYS_STATUS, health 0x10000000)" in blocking(verdict)


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_an_empty_battery(flavour: str) -> None:
    bench = Bench(autopilot(flavour, failures="obeyed"))
    bench.run(3.0)
    bench.order(
        mavlink.MAV_CMD_INJECT_FAILURE, mavlink.FAILURE_UNIT_SYSTEM_BATTERY, mavlink.FAILURE_TYPE_OFF, 0
    )
    bench.run(3.0)
    verdict = bench.consult()
    assert found(verdict, "battery: ").severity is Severity.BLOCKING
    assert "charged battery" in found(verdict, "battery: ").do


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_before_there_is_an_origin(flavour: str) -> None:
    bench = Bench(autopilot(flavour, ready_after=600.0, startup="in stages"))
    bench.run(3.0)
    verdict = bench.consult()
    assert not verdict.ready
    for words in (
        "no GPS_GLOBAL_ORIGIN, though it was asked for",
        "LOCAL_POSITION_NED does not come",
        "the pre-arm check fails",
        "GPS: no fix",
        "it is still starting",
    ):
        assert found(verdict, words).severity is Severity.BLOCKING
        assert found(verdict, words).do


@pytest.mark.parametrize(
    ("number", "name"), [(32, "LOCAL_POSITION_NED"), (30, "ATTITUDE"), (1, "SYS_STATUS")]
)
def test_a_message_that_does_not_come(number: int, name: str) -> None:
    bench = Bench(autopilot("px4"), passes=lambda frame: frame.message_id != number)
    bench.run(3.0)
    verdict = bench.consult()
    assert blocking(verdict) == [f"{name} does not come"]
    asked = [one for one in bench.received if isinstance(one, CommandLong) and one.params[0] == number]
    assert len(asked) == 3  # and then it gives up


@pytest.mark.parametrize(
    ("action", "value", "words"),
    [
        ("descend", 0, "sinks at 0.6 m/s"),
        ("return", 3, "returns home"),
        ("land", 4, "lands"),
        ("hold", 5, "holds"),
    ],
)
def test_what_px4_does_without_setpoints(action: str, value: int, words: str) -> None:
    bench = Bench(autopilot("px4", offboard_loss=action))
    bench.run(3.0)
    verdict = bench.consult()
    finding = found(verdict, f"COM_OBL_RC_ACT = {value}")
    assert words in finding.why
    assert finding.severity is {0: Severity.WARNING, 5: Severity.OK}.get(value, Severity.NOTE)
    assert value == 5 or "5 (hold)" in finding.do
    assert verdict.ready


@pytest.mark.parametrize(
    ("flavour", "settings", "name"),
    [
        ("ardupilot", {"guided_timeout": 4.5}, "GUID_TIMEOUT = 4.5"),
        ("px4", {"offboard_timeout": 5.0}, "COM_OF_LOSS_T = 5"),
        ("px4", {"failures": "obeyed"}, "SYS_FAILURE_EN = 1"),
    ],
)
def test_settings_that_can_hurt(flavour: str, settings: dict[str, Any], name: str) -> None:
    bench = Bench(autopilot(flavour, **settings))
    bench.run(3.0)
    verdict = bench.consult()
    assert [what for what in warnings(verdict) if not what.startswith(FOLLOWS)] == [name]
    assert found(verdict, name).do.startswith("Set ")


@pytest.mark.parametrize(
    ("seconds", "severity", "words"),
    [
        (0.2, Severity.WARNING, "A short break"),
        (0.3, Severity.OK, "for 0.3 s"),
        (1.0, Severity.OK, "for 1 s"),
        (1.5, Severity.NOTE, "saves 0.5 s of that, 1 m at 2 m/s"),
        (3.0, Severity.NOTE, "saves 2 s of that, 4 m at 2 m/s"),
        (4.0, Severity.WARNING, "saves 3 s of that, 6 m at 2 m/s"),
    ],
)
def test_how_long_arducopter_flies_on_and_what_a_second_buys(
    seconds: float, severity: Severity, words: str
) -> None:
    bench = Bench(autopilot(guided_timeout=seconds))
    bench.run(3.0)
    finding = found(bench.consult(), f"GUID_TIMEOUT = {seconds:g}")
    assert finding.severity is severity
    assert words in finding.why
    assert severity is Severity.OK or "Set GUID_TIMEOUT to 1 s" in finding.do


def test_two_vehicles_on_one_link() -> None:
    bench = Bench(autopilot("px4", 11), autopilot("ardupilot", 12))
    bench.run(3.0)
    for system, name, other in ((11, "PX4", 12), (12, "ArduPilot", 11)):
        verdict = bench.consult(system)
        assert found(verdict, f"{name} ").what.endswith(f"system {system}")
        assert found(verdict, f"another vehicle on this link: system {other}").severity is Severity.WARNING
        assert verdict.ready


def test_of_several_it_is_the_lowest_and_all_of_it() -> None:
    bench = Bench(autopilot("px4", 13), autopilot("ardupilot", 12), boots=(0, 2_000_000))
    bench.run(1.0)
    verdict = bench.consult()
    assert found(verdict, "ArduPilot ").what.endswith("system 12")
    assert all(found(verdict, f"{rule.name} = ") for rule in rules(px4=False))


@pytest.mark.parametrize("later", [60_000, 8_000_000])
def test_two_vehicles_with_one_id(later: int) -> None:
    # With sensors' noise: two without it say the same, byte for byte.
    bench = Bench(*(autopilot(seed=seed, sensors="rtk") for seed in (1, 2)), boots=(0, later))
    bench.run(12.0)
    verdict = bench.consult()
    assert "two vehicles with the same system id 11" in blocking(verdict)
    assert "SYSID_THISMAV" in found(verdict, "same system id").do


def test_a_system_that_is_not_there() -> None:
    bench = Bench(autopilot("px4", 11), autopilot("px4", 12))
    bench.run(3.0)
    verdict = bench.consult(7)
    assert blocking(verdict) == ["system 7 is not there; here are 11, 12"]
    assert "--system 11" in verdict.findings[0].do
    assert all(isinstance(message, Heartbeat) for message in bench.received)


def test_nobody() -> None:
    verdict = Bench().consult(seconds=4.0)
    assert blocking(verdict) == ["nothing arrives in 4 s"]


def test_only_a_ground_station() -> None:
    beats = Codec()
    received = Bench().consult(seconds=4.0, beside=lambda _now: [beats.encode(Heartbeat(GCS, 6, 8, 0, 0, 4))])
    assert blocking(received) == ["no autopilot's HEARTBEAT; only 255/190 can be heard"]


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_one_that_flies(flavour: str) -> None:
    bench = Bench(autopilot(flavour))
    bench.run(3.0)
    if flavour == "ardupilot":
        bench.order(SET_MODE, *GUIDED[flavour])
    bench.order(ARM, 1)
    bench.order(TAKEOFF, *[math.nan] * 6, 5.0 if flavour == "ardupilot" else math.nan)
    bench.run(8.0)
    verdict = bench.consult()
    finding = found(verdict, "armed, in the air")
    assert finding.severity is Severity.WARNING
    assert bench.vehicles[0].armed


def test_somebody_steers_already() -> None:
    other = Source(11, 191)
    codec = Codec()
    zero = (0.0, 0.0, 0.0)
    target = SetpointLocal(other, 0, 11, 1, 1, 0x9C0, zero, zero, zero, 0.0, 0.0)
    bench = Bench(autopilot("px4"))
    bench.run(3.0)
    verdict = bench.consult(beside=lambda _now: [codec.encode(target)])
    (said,) = blocking(verdict)
    assert said.startswith("11/191 sends set-points")


def test_a_ground_station_that_is_not_the_one_it_watches() -> None:
    vehicle = autopilot()
    bench = Bench(vehicle)
    bench.run(2.0)
    codec = Codec()
    with_param(bench, "FS_GCS_ENABLE", 1.0)
    right = bench.consult(beside=lambda _now: [codec.encode(Heartbeat(GCS, 6, 8, 0, 0, 4))])
    assert found(right, "FS_GCS_ENABLE = 1").severity is Severity.NOTE
    with_param(bench, "SYSID_MYGCS", 252.0)
    wrong = bench.consult(beside=lambda _now: [codec.encode(Heartbeat(GCS, 6, 8, 0, 0, 4))])
    assert found(wrong, "FS_GCS_ENABLE = 1").severity is Severity.WARNING
    assert "252" in found(wrong, "FS_GCS_ENABLE = 1").why


def test_a_simulation_that_is_sped_up() -> None:
    bench = Bench(autopilot("px4"), speed=5)
    bench.run(3.0)
    verdict = bench.consult()
    assert verdict.ready
    assert found(verdict, "its clock runs 5.0").severity is Severity.NOTE
    assert found(verdict, "LOCAL_POSITION_NED at 20")


def test_a_signed_vehicle() -> None:
    key = Key(b"k" * 32)

    def bench() -> Bench:
        vehicle = Bench(autopilot("px4", signing=Signing(key)))
        vehicle.run(3.0)
        return vehicle

    unsigned = bench().consult()
    assert found(unsigned, "of its messages are signed").severity is Severity.NOTE
    assert "no GPS_GLOBAL_ORIGIN" not in "".join(blocking(unsigned))  # it flows by itself
    assert found(unsigned, "COM_OBL_RC_ACT is not told").severity is Severity.WARNING
    signed = bench().consult(signing=Signing(key), now=1_700_000_003_000_000)
    assert signed.ready
    assert found(signed, "COM_OBL_RC_ACT = 5").severity is Severity.OK
    wrong = bench().consult(signing=Signing(Key(b"x" * 32)), now=1_700_000_003_000_000)
    (said,) = blocking(wrong)
    assert "frames arrive, and none counts: signed with another key" in said


@pytest.mark.parametrize(("baud", "severity"), [(38_400, Severity.WARNING), (115_200, Severity.OK)])
def test_the_room_on_a_serial_port(baud: int, severity: Severity) -> None:
    bench = Bench(autopilot("px4"))
    bench.run(3.0)
    assert found(bench.consult(baud=baud), "of the port) are taken").severity is severity


def test_one_that_falls_silent() -> None:
    bench = Bench(autopilot("px4"))
    bench.run(3.0)
    verdict = bench.consult(until=5.0, seconds=20.0)
    assert verdict.ready  # all was answered before
    mute = Bench(autopilot("px4"), passes=lambda frame: frame.message_id != 22)
    mute.run(3.0)
    gone = mute.consult(until=2.0, seconds=15.0)
    assert "no HEARTBEAT for" in "".join(blocking(gone))


def with_param(bench: Bench, name: str, value: float) -> None:
    bench.tick(ParamSet(GCS, pack("<f", value), 11, 1, name, 9))
    bench.run(0.1)
