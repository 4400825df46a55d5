"""What an autopilot can follow: the doctor reads it, and says what a lowered parameter costs."""

from __future__ import annotations

import math
from struct import pack

import pytest

from companion.flight.autopilots.limits import STOCK, limits_of, stock_parameters
from mavlink_bridge.messages import ParamRequestRead, ParamSet
from outrider.doctor.agility import Demand, lowered, shipped, summary
from outrider.doctor.finding import Severity, Verdict
from tests.outrider.doctor.bench import GCS, Bench, autopilot, found, warnings
from tests.sitl.autopilot_rig import FLAVOURS

NUMBERS = {"ardupilot": 3, "px4": 12}
REAL32, INT16 = 9, 4


def judged(flavour: str, changed: dict[str, float]) -> Verdict:
    """Of an emulated vehicle with these parameters."""
    bench = Bench(autopilot(flavour))
    bench.run(3.0)
    for name, value in changed.items():
        kind = INT16 if name == "ANGLE_MAX" else REAL32
        bench.tick(ParamSet(GCS, pack("<f", value), 11, 1, name, kind))
    bench.run(0.5)
    return bench.consult()


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_the_stock_vehicle_follows_what_the_stock_firmware_does(flavour: str) -> None:
    verdict = judged(flavour, {})
    what = {
        "ardupilot": "it follows up to 2.5 m/s², 5 m/s³, 10 m/s and 30° of tilt",
        "px4": "it follows up to 3 m/s², 8 m/s³, 12 m/s and 45° of tilt",
    }[flavour]
    asked = shipped(NUMBERS[flavour])
    low = STOCK[NUMBERS[flavour]].usable_acceleration < asked.acceleration
    assert found(verdict, what).severity is (Severity.WARNING if low else Severity.OK)
    assert not [one for one in warnings(verdict) if "stock" in one]


@pytest.mark.parametrize(
    ("flavour", "name", "value", "words"),
    [
        ("ardupilot", "PSC_JERK_XY", 1.0, "from 5 m/s it stops in 11.2 m, stock in 6.2 m"),
        ("ardupilot", "WPNAV_ACCEL", 50.0, "from 5 m/s it stops in 25.3 m, stock in 6.2 m"),
        ("ardupilot", "WPNAV_SPEED", 200.0, "corrects its way with 2 m/s at most, stock 10 m/s"),
        ("ardupilot", "ANGLE_MAX", 2000.0, "20° of tilt give 3.6 m/s²"),
        ("ardupilot", "PSC_POSXY_P", 0.5, "A distance from the set-point halves in 1.4 s, stock in 0.7 s"),
        ("ardupilot", "PSC_VELXY_P", 1.0, "A difference in velocity halves in 0.7 s, stock in 0.3 s"),
        ("ardupilot", "WPNAV_SPEED_DN", 50.0, "climbs or sinks with 0.5 m/s at most, stock 1.5 m/s"),
        ("px4", "MPC_Z_VEL_MAX_UP", 1.0, "climbs or sinks with 1 m/s at most, stock 1.5 m/s"),
        ("px4", "MPC_ACC_HOR", 2.0, "enforces it in its own modes"),
        ("px4", "MPC_JERK_MAX", 2.0, "enforces it in its own modes"),
        ("px4", "MPC_JERK_AUTO", 2.0, "change acceleration by 2 m/s³ at most"),
        ("px4", "MPC_XY_VEL_MAX", 3.0, "with 3 m/s at most, stock 12 m/s"),
        ("px4", "MPC_TILTMAX_AIR", 25.0, "25° of tilt give 4.6 m/s²"),
        ("px4", "MPC_XY_P", 0.5, "A distance from the set-point halves in 1.4 s"),
    ],
)
def test_a_lowered_parameter_is_named_with_what_it_costs(
    flavour: str, name: str, value: float, words: str
) -> None:
    verdict = judged(flavour, {name: value})
    finding = found(verdict, f"{name} = {value:g}")
    assert finding.severity is Severity.WARNING
    assert words in finding.why
    assert finding.do.startswith(f"Set {name} to ")


def test_two_lowered_parameters_are_both_named_and_the_summary_has_them_together() -> None:
    verdict = judged("ardupilot", {"PSC_JERK_XY": 1.0, "WPNAV_ACCEL": 50.0})
    assert {"PSC_JERK_XY = 1, stock is 5", "WPNAV_ACCEL = 50, stock is 250"} <= set(warnings(verdict))
    finding = found(verdict, "it follows up to 0.5 m/s², 1 m/s³")
    assert finding.severity is Severity.WARNING
    assert "From 5 m/s it stops in 26.2 m." in finding.why


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_every_parameter_that_decides_it_is_asked_for(flavour: str) -> None:
    bench = Bench(autopilot(flavour))
    bench.run(3.0)
    bench.consult()
    asked = {one.name for one in bench.received if isinstance(one, ParamRequestRead)}
    assert set(stock_parameters(NUMBERS[flavour])) <= asked


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_what_is_not_told_is_a_note(flavour: str) -> None:
    bench = Bench(autopilot(flavour), passes=lambda frame: frame.message_id != 22)
    bench.run(3.0)
    finding = found(bench.consult(), "what it can follow is not told")
    assert finding.severity is Severity.NOTE
    assert set(stock_parameters(NUMBERS[flavour])) <= set(
        finding.why.replace(".", ",").replace(": ", ", ").split(", ")
    )


@pytest.mark.parametrize("number", NUMBERS.values())
def test_what_a_companion_asks_beyond_the_limits_is_a_warning(number: int) -> None:
    limits = STOCK[number]
    within = Demand(limits.usable_acceleration, limits.speed, 6.0)
    assert summary(limits, within, "file").severity is Severity.OK
    more = summary(limits, within._replace(acceleration=limits.acceleration + 1.0), "file")
    assert more.severity is Severity.WARNING
    assert f"asks for {limits.acceleration + 1.0:g} m/s² an axis, 6 with its field" in more.why
    faster = summary(limits, within._replace(speed=limits.speed + 1.0), "file")
    assert (faster.severity, f"{limits.speed + 1.0:g} m/s" in faster.why) == (Severity.WARNING, True)


@pytest.mark.parametrize("number", NUMBERS.values())
def test_a_parameter_at_stock_or_above_costs_nothing(number: int) -> None:
    for name, stock in stock_parameters(number).items():
        for value in (stock, math.nextafter(stock, -math.inf), 1.5 * stock):
            assert not list(lowered(number, name, value)), name


@pytest.mark.parametrize("number", NUMBERS.values())
@pytest.mark.parametrize("value", [0.0, -1.0, 1e-30])
def test_no_value_is_too_absurd_to_be_judged(number: int, value: float) -> None:
    for name in stock_parameters(number):
        for finding in lowered(number, name, value):
            assert finding.why
        assert summary(limits_of(number, {name: value}), Demand(3.0, 5.0, 6.0), "file").why
