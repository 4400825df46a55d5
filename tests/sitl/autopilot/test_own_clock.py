"""The autopilot's own clock: its stamps drift, and its UTC is set once and drifts with them."""

from __future__ import annotations

import pytest

from mavlink_bridge.messages import LocalPosition, Source, SystemTime, Timesync
from tests.sitl.autopilot_rig import FLAVOURS, INTERVAL, Rig

EPOCH = 1_767_225_600_000_000
SYSTEM_TIME = 2


def told(rig: Rig) -> tuple[int, SystemTime]:
    """The last SYSTEM_TIME, and when it was sent (µs since boot)."""
    return [(at, message) for at, message in rig.received if isinstance(message, SystemTime)][-1]


def flown(flavour: str, seconds: float = 30.0, **settings: object) -> Rig:
    rig = Rig(flavour, tick=10_000, epoch=EPOCH, **settings)
    rig.order(INTERVAL, SYSTEM_TIME, 1_000_000)
    rig.run(seconds)
    return rig


@pytest.mark.parametrize("flavour", FLAVOURS)
@pytest.mark.parametrize("ppm", [0.0, 50.0, -10_000.0])
def test_all_stamps_and_utc_run_on_its_clock(flavour: str, ppm: float) -> None:
    rig = flown(flavour, clock_drift_ppm=ppm, utc_error_us=7_000)
    at, time = told(rig)
    fast = at * ppm / 1e6
    assert abs(time.time_boot - at - fast) <= 1_000
    # It learns UTC when it is ready, after 1 s; what the clock was off until then does not count.
    assert abs(time.unix_time - (EPOCH + at + 7_000) - (at - 1e6) * ppm / 1e6) <= abs(ppm) / 50 + 1
    stamped = [(when, m.time_boot) for when, m in rig.received if isinstance(m, LocalPosition)][-1]
    assert abs(stamped[1] - stamped[0] * (1 + ppm / 1e6)) <= 1_000
    rig.step(Timesync(Source(11, 195), 0, 42))
    answer = rig.all(Timesync)[-1]
    assert answer.ts1 == 42
    assert abs(answer.tc1 / 1000 - (rig.now - rig.tick) * (1 + ppm / 1e6)) <= 1


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_utc_is_unknown_before_there_is_a_position(flavour: str) -> None:
    rig = flown(flavour, 12.0, ready_after=5.0)
    times = [(at, m.unix_time) for at, m in rig.received if isinstance(m, SystemTime)]
    assert {unix for at, unix in times if at < 5_000_000} == {0}
    assert all(unix == EPOCH + at for at, unix in times if at > 5_100_000)
    assert len(times) >= 12


def test_utc_steps_by_what_it_is_told_and_the_time_since_boot_does_not() -> None:
    rig = flown("px4", 10.0)
    rig.autopilot.shift_utc(-5_000_000)
    rig.run(2.0)
    at, time = told(rig)
    assert (time.unix_time, time.time_boot) == (EPOCH + at - 5_000_000, at)


def test_where_steps_are_in_unix_time_the_first_is_the_boot() -> None:
    rig = Rig("ardupilot", epoch_from_steps=True)
    rig.now = EPOCH
    rig.order(INTERVAL, SYSTEM_TIME, 1_000_000)
    rig.run(5.0)
    at, time = told(rig)
    assert time.unix_time == at
    assert time.time_boot == at - EPOCH
