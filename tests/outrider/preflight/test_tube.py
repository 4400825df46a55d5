"""Tracking error from a log: the distance that the vehicle had from its set-points, whatever their rates."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mavlink_bridge.messages import Heartbeat, LocalPosition, Message, SetpointLocal, Source, Vector
from mavlink_bridge.tlog.log import TlogWriter
from mavlink_bridge.wire.codec import Codec
from outrider.errors import InputError
from outrider.preflight.tube import tracking_error

OWN, AUTOPILOT = Source(1, 195), Source(1, 1)
BEGIN = 1_700_000_000_000_000
GUIDED = 4
RADIUS, RATE = 4.0, 0.7
"""m, rad/s: a circle with 1.96 m/s²."""


def circle(time: float) -> tuple[Vector, Vector, Vector]:
    """Position, velocity and acceleration at ``time`` s."""
    c, s = math.cos(RATE * time), math.sin(RATE * time)
    return (
        (RADIUS * c, RADIUS * s, -5.0),
        (-RADIUS * RATE * s, RADIUS * RATE * c, 0.0),
        (-RADIUS * RATE**2 * c, -RADIUS * RATE**2 * s, 0.0),
    )


def setpoint(time: float, **changes: object) -> SetpointLocal:
    place, velocity, acceleration = circle(time)
    message = SetpointLocal(OWN, round(1e6 * time), 1, 1, 1, 0, place, velocity, acceleration, 0.0, 0.0)
    return message._replace(**changes)


def position(time: float, off: Vector = (0.0, 0.0, 0.0), source: Source = AUTOPILOT) -> LocalPosition:
    place, velocity, _ = circle(time)
    x, y, z = (a + b for a, b in zip(place, off, strict=True))
    return LocalPosition(source, round(1e6 * time), (x, y, z), velocity)


def beat(mode: int = GUIDED, base_mode: int = 0x81) -> Heartbeat:
    return Heartbeat(AUTOPILOT, 2, 3, base_mode, mode, 4)


def log(path: Path, messages: list[tuple[float, Message]]) -> Path:
    """A log in which the autopilot follows set-points from the first second on, and those ``messages``."""
    codec = Codec()
    if not any(isinstance(message, Heartbeat) for _, message in messages):
        messages = [(0.0, beat()), *messages]
    with TlogWriter(path) as writer:
        for time, message in sorted(messages, key=lambda one: one[0]):
            writer.write(BEGIN + round(1e6 * time), 0, codec.encode(message))
    return path


def flown(
    path: Path, off: Vector = (0.0, 0.0, 0.0), seconds: float = 20.0, hz: float = 20.0, offset: float = 0.003
) -> Path:
    """Set-points at 50 Hz, positions at ``hz``."""
    sent: list[tuple[float, Message]] = [(0.02 * k, setpoint(0.02 * k)) for k in range(round(50 * seconds))]
    times = [offset + k / hz for k in range(round(hz * (seconds - 0.1)))]
    return log(path, sent + [(time, position(time, off)) for time in times])


@given(st.tuples(*[st.floats(-2.0, 2.0)] * 3), st.floats(5.0, 50.0), st.floats(0.0, 0.02))
@settings(max_examples=25)
def test_it_is_the_distance_from_the_set_points(
    tmp_path_factory: pytest.TempPathFactory, off: Vector, hz: float, offset: float
) -> None:
    path = flown(tmp_path_factory.mktemp("log") / "flight.tlog", off, hz=hz, offset=offset)
    found = tracking_error(path, 1, planar=False)
    assert found.largest == pytest.approx(math.hypot(*off), abs=2e-3)
    assert found.acceleration == pytest.approx(RADIUS * RATE**2, rel=1e-3)
    flat = tracking_error(path, 1, planar=True)
    assert flat.largest == pytest.approx(math.hypot(*off[:2]), abs=2e-3)


def test_set_points_count_for_the_time_that_they_are_sent_ahead(tmp_path: Path) -> None:
    lead = 0.1
    ahead: list[tuple[float, Message]] = [(0.02 * k, setpoint(0.02 * k + lead)) for k in range(1000)]
    path = log(tmp_path / "flight.tlog", ahead + [(0.05 * k, position(0.05 * k)) for k in range(390)])
    assert tracking_error(path, 1, planar=False, lead=100_000).largest < 2e-3
    assert tracking_error(path, 1, planar=False).largest > 0.5 * lead * RADIUS * RATE


def test_an_acceleration_against_drag_is_none_of_the_motion(tmp_path: Path) -> None:
    """Nor is a jump of the velocity, where a plan begins anew."""

    def sent(time: float) -> SetpointLocal:
        _, velocity, acceleration = circle(time)
        jump = 5.0 if time > 7.0 else 0.0
        return setpoint(
            time,
            acceleration=tuple(2.0 * a for a in acceleration),
            velocity=(velocity[0] + jump, *velocity[1:]),
        )

    messages: list[tuple[float, Message]] = [(0.02 * k, sent(0.02 * k)) for k in range(1000)]
    path = log(tmp_path / "flight.tlog", messages + [(0.05 * k, position(0.05 * k)) for k in range(390)])
    found = tracking_error(path, 1, planar=False).acceleration
    assert found <= 2.0 * RADIUS * RATE**2 + 1e-3
    calm = [one for one in messages if one[0] < 6.9]
    flown = [(0.05 * k, position(0.05 * k)) for k in range(136)]
    later = [(7.0 + t, m._replace(velocity=(0.0,) * 3, acceleration=(0.0,) * 3)) for t, m in calm]
    path = log(tmp_path / "calm.tlog", calm + flown + later + [(7.0 + t, m) for t, m in flown])
    assert tracking_error(path, 1, planar=False).acceleration == pytest.approx(RADIUS * RATE**2, rel=1e-3)


def test_one_excursion_counts_in_full(tmp_path: Path) -> None:
    sent: list[tuple[float, Message]] = [(0.02 * k, setpoint(0.02 * k)) for k in range(1000)]
    times = [0.005 + 0.05 * k for k in range(390)]
    beside = [
        (time, position(time, (0.0, 1.5, 0.0) if k == 200 else (0.1, 0.0, 0.0)))
        for k, time in enumerate(times)
    ]
    assert tracking_error(
        log(tmp_path / "flight.tlog", sent + beside), 1, planar=False
    ).largest == pytest.approx(1.5, abs=2e-3)


def test_what_is_flown_without_set_points_and_by_others_does_not_count(tmp_path: Path) -> None:
    """A second after the last set-point the autopilot flies by itself; 2 is another vehicle."""
    sent: list[tuple[float, Message]] = [(0.02 * k, setpoint(0.02 * k)) for k in range(1000)]
    sent += [(0.01 + 0.05 * k, position(0.01 + 0.05 * k)) for k in range(390)]
    sent += [(21.0 + 0.05 * k, position(21.0 + 0.05 * k, (9.0, 0.0, 0.0))) for k in range(100)]
    sent += [(0.011 + 0.05 * k, position(0.0, (9.0, 0.0, 0.0), Source(2, 1))) for k in range(390)]
    sent += [(0.012 + k, setpoint(0.012 + k, position=(math.nan,) * 3, type_mask=0x007)) for k in range(19)]
    found = tracking_error(log(tmp_path / "flight.tlog", sent), 1, planar=False)
    assert found.largest < 2e-3
    assert 19.0 < found.seconds < 20.0


@pytest.mark.parametrize("before", [beat(mode=5), beat(base_mode=0x01)], ids=["another mode", "disarmed"])
def test_only_what_is_flown_by_set_points_counts(before: Heartbeat, tmp_path: Path) -> None:
    """Some are sent before the autopilot follows them; heartbeats of the companion change nothing."""
    companion = Heartbeat(OWN, 18, 8, 0, 0, 4)
    sent: list[tuple[float, Message]] = [(0.0, before), (5.0, beat()), (6.0, companion)]
    sent += [(0.001 + 0.02 * k, setpoint(0.001 + 0.02 * k)) for k in range(1000)]
    times = [0.005 + 0.05 * k for k in range(390)]
    sent += [(time, position(time, (3.0, 0.0, 0.0) if time < 5.0 else (0.2, 0.0, 0.0))) for time in times]
    found = tracking_error(log(tmp_path / "flight.tlog", sent), 1, planar=False)
    assert found.largest == pytest.approx(0.2, abs=2e-3)
    assert found.seconds == pytest.approx(14.5, abs=0.2)


@pytest.mark.parametrize("system", [1, 2])
def test_a_log_without_enough_of_the_vehicle_is_refused(system: int, tmp_path: Path) -> None:
    path = flown(tmp_path / "flight.tlog", seconds=5.0 if system == 1 else 20.0)
    with pytest.raises(InputError, match=f"set-points and positions of vehicle {system}; needed: 10 s"):
        tracking_error(path, system, planar=False)


def test_what_is_no_log_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "flight.tlog"
    with pytest.raises(InputError, match="--flight"):
        tracking_error(path, 1, planar=False)
    path.write_bytes(b"nothing")
    with pytest.raises(InputError, match="--flight"):
        tracking_error(path, 1, planar=False)
