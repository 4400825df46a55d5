"""What goes wrong in a flight, row by row: the one that is struck does what its autopilot's time-outs and its
sensors say, the others go on, and the summary tells it.

Separation is asserted only where it is promised. A vehicle that says nothing for longer than a plan lives
(half a second) is taken for one that stands still; while it flies on by itself nobody can avoid it. The two
sides of a partition are that to each other.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from companion.values.phase import Phase
from mavlink_bridge.messages import SetpointLocal, StatusText, Tunnel
from outrider.runs.names import LINK_NUMBERS
from outrider.runs.summary import exit_status
from outrider.simulation.conductor import NEAR
from sitl.autopilot.firmware import Mode
from tests.scenarios.flight_facts import arrived, check_told, clock, figure, log, spoke
from tests.scenarios.lockstep_flights import Flown, fly, scenario

STRUCK = 12
K = 1
"""The place of the one that is struck among the vehicles."""
AT = 1.5
"""s after the goal event: on the way, at 3 m/s."""
SWAP = {"vehicles": 3, "airborne": True, "cap_s": 25.0, "starts": {"radius": 6.0}}


def hung(seconds: float) -> Callable[[Flown], None]:
    """No set-point for so long, and then they flow again."""

    def check(flown: Flown) -> None:
        sent = np.array([h.time for h in log(flown, STRUCK) if isinstance(h.message, SetpointLocal)])
        gaps = np.diff(sent)
        longest = int(np.argmax(gaps))
        assert sent[longest] == pytest.approx(AT, abs=0.05)
        assert gaps[longest] == pytest.approx(seconds, abs=0.05)
        assert np.delete(gaps, longest).max() < 0.05

    return check


def coasted_and_held(timeout: float, mode: Mode) -> Callable[[Flown], None]:
    """Carried on at its last velocity until the autopilot's time-out, braked at the gentle 1.5 m/s², held."""

    def check(flown: Flown) -> None:
        assert max(h.time for h in log(flown, STRUCK)) == pytest.approx(AT, abs=0.05)
        autopilot = flown.flight.autopilots[K]
        samples, times = clock(flown)
        speed = np.linalg.norm(samples.velocity[:, K], axis=1)
        end = AT + timeout
        pace = float(speed[np.searchsorted(times, end)])
        assert pace > 2.0
        # An acceleration is carried on for a second; from then on there is only the velocity.
        assert np.ptp([pace, *speed[(times > AT + 1.3) & (times < end)]]) < 0.2
        halfway = 0.5 * pace / autopilot.config.gentle_acceleration
        assert speed[np.searchsorted(times, end + halfway)] == pytest.approx(0.5 * pace, abs=0.35)
        rests = times > end + 2.0 * halfway + 2.0
        assert rests.sum() > 50
        assert speed[rests].max() < 0.05
        assert np.ptp(samples.position[rests, K], axis=0).max() < 0.05
        assert (autopilot.mode, autopilot.airborne, autopilot.armed) == (mode, True, True)

    return check


def coasted_blind(flown: Flown) -> None:
    """The estimate drifts while there is no GPS, and returns within some seconds."""
    samples, times = clock(flown)
    off = np.linalg.norm(samples.estimate_error[:, K], axis=1)
    assert (off[times <= AT] == 0.0).all()
    gone = off[(times > AT + 0.1) & (times < AT + 3.0)]
    assert (np.diff(gone) > 0.0).all()
    # ½ a t² with σ_a = 0.05 m/s² on each of two axes, four σ.
    assert gone.max() < 0.5 * (4.0 * 0.05 * np.sqrt(2.0)) * 3.0**2
    assert off[-1] < 0.05
    assert figure(flown, "estimate_error_m", "max") == pytest.approx(off.max(), abs=1e-4)


def landed_blind(after: float, text: str) -> Callable[[Flown], None]:
    """Said that it has no position ``after`` seconds without GPS, and came down by itself. Its companion did
    not order that, and does not fight it."""

    def check(flown: Flown) -> None:
        texts = [h for h in log(flown, STRUCK) if isinstance(h.message, StatusText)]
        (said,) = [h.time for h in texts if isinstance(h.message, StatusText) and h.message.text == text]
        assert said - AT == pytest.approx(after, abs=0.1)
        autopilot, companion = flown.flight.autopilots[K], flown.flight.companions[K]
        assert not autopilot.airborne
        assert not autopilot.armed
        assert companion.pilot.phase is Phase.CONNECT
        assert not companion.pilot.streaming
        assert figure(flown, "estimate_error_m", "max") > 0.5
        samples, times = clock(flown)
        height = samples.position[:, K, 2]
        assert np.abs(height[times < said] - height[0]).max() < 2.0
        sinking = -samples.velocity[(times > said + 1.5) & (height > 1.0), K, 2]
        assert sinking.mean() == pytest.approx(autopilot.config.land_speed, abs=0.1)
        assert abs(height[-1]) < 0.1

    return check


def went_astray(flown: Flown) -> None:
    """A jump within the gate is followed with a time constant of 1 s, and forgotten as fast."""
    samples, times = clock(flown)
    off = np.linalg.norm(samples.estimate_error[:, K], axis=1)
    assert off.max() == pytest.approx(2.0 * (1.0 - np.exp(-3.0)), abs=0.02)
    assert times[np.argmax(off)] == pytest.approx(AT + 3.0, abs=0.05)
    assert off[-1] < 0.05


def never_noticed(flown: Flown) -> None:
    """A jump beyond the gate is refused for seven seconds; this one was over before."""
    assert flown.summary["estimate_error_m"] == {"p95": 0.0, "max": 0.0}


def believed_in_the_end(flown: Flown) -> None:
    """Seven seconds after the goal event the estimate jumps, and the vehicle is led by it: beside its goal,
    which it believes to have reached. What it flies starts anew where it believes to be."""
    samples, times = clock(flown)
    off = samples.estimate_error[:, K]
    assert set(np.linalg.norm(off, axis=1).round(3)) == {0.0, 5.0}
    assert times[np.argmax(off[:, 0] > 4.0)] == pytest.approx(7.0, abs=0.05)
    assert flown.summary["anchored_anew"] == 1
    goals = flown.flight.fleet.starts.goals
    assert goals is not None
    assert np.linalg.norm(samples.position[-1, K] + off[-1] - goals[K]) < NEAR


def flew_on_five(flown: Flown) -> None:
    """Its rotor stands still, the others carry it, and it kept to its way."""
    speeds = flown.flight.autopilots[K].state.rotor_speeds
    assert speeds[0] == 0.0
    assert (speeds[1:] > 100.0).all()
    assert figure(flown, "tracking_error_m", "max") < 0.6


def understood(flown: Flown) -> None:
    """A wrong clock is found out after a few plans; from then on none is refused."""
    told = sum(isinstance(h.message, Tunnel) and h.message.source.system == STRUCK for h in log(flown, 11))
    assert told > 50
    for companion in flown.flight.companions:
        assert companion.world.neighbours.refused_plans <= 5


def cut_and_healed(flown: Flown) -> None:
    """Nothing passes between the two sides for as long as said, and everything before and after."""
    everyone = set(flown.flight.systems)
    for listener in everyone:
        side = {11, 12} if listener in (11, 12) else {13}
        assert spoke(flown, listener, 0.0, 1.0) == everyone - {listener}
        assert spoke(flown, listener, 1.1, 5.0) == side - {listener}
        assert spoke(flown, listener, 5.0, 6.0) == everyone - {listener}


def heard_by_none(flown: Flown) -> None:
    assert spoke(flown, STRUCK) == {11, 13}
    assert spoke(flown, 11) == {13}


def heard_none(flown: Flown) -> None:
    assert spoke(flown, STRUCK) == set()
    assert spoke(flown, 11) == {12, 13}


def lost_in_a_row(flown: Flown) -> None:
    """Of what one said to another some is missing, and more than a plan lives for at a time."""
    said, received = (
        [
            h.time
            for h in log(flown, system)
            if h.link == LINK_NUMBERS["swarm"] and h.message.source.system == 11
        ]
        for system in (11, 13)
    )
    assert 0.3 < len(received) / len(said) < 0.95
    assert np.diff(received).max() > 0.5


def fault(kind: str, at_s: float = AT, **keys: Any) -> dict[str, Any]:
    return {"faults": [{"kind": kind, "vehicle": STRUCK, "at_s": at_s, **keys}]}


def late(milliseconds: float) -> dict[str, Any]:
    return {"faults": [{"kind": "clock", "vehicle": STRUCK, "late_ms": milliseconds, "drift_ppm": 200.0}]}


def one_way(**ends: int) -> dict[str, Any]:
    return {"links": {"swarm": {"directions": [{**ends, "loss": 1.0}]}}}


@dataclass(frozen=True)
class Row:
    """A flight: what is changed in it, what holds then, whether nobody may come too near, and whether all
    arrive, or all but the one that is struck."""

    name: str
    changes: dict[str, Any]
    then: Callable[[Flown], None] | None = None
    apart: bool = True
    all_arrive: bool = True


PX4 = {"flavour": "px4"}
GONE = {**fault("vanish"), "cap_s": 12.0}
BLIND = fault("gps_loss", for_s=3_600.0)
SHIFTED = {
    **fault("gps_jump", at_s=0.0, for_s=3_600.0, offset=[5.0, 0.0, 0.0]),
    "starts": {"radius": 16.0},
    "cap_s": 16.0,
}
"""It is believed after seven seconds: the way must take longer."""
SIDES = {"partitions": [{"at_s": 1.0, "for_s": 4.0, "members": [11, 12]}]}
BURSTS = {"links": {"swarm": {"loss": 0.3, "burst": 10.0}}}
ROWS = (
    # Shorter than a plan lives: the others know all the while where it flies.
    Row("hangs shortly", fault("freeze", for_s=0.4), hung(0.4)),
    Row("hangs", fault("freeze", for_s=1.5), hung(1.5), apart=False),
    Row("gone, ArduPilot", GONE, coasted_and_held(3.0, Mode.GUIDED), apart=False, all_arrive=False),
    Row("gone, PX4", {**GONE, **PX4}, coasted_and_held(1.0, Mode.HOLD), apart=False, all_arrive=False),
    Row("no GPS for 3 s", fault("gps_loss", for_s=3.0), coasted_blind),
    Row(
        "no GPS any more, ArduPilot",
        {**BLIND, "cap_s": 18.5},
        landed_blind(8.0, "EKF Failsafe: changed to LAND Mode"),
        apart=False,
        all_arrive=False,
    ),
    Row(
        "no GPS any more, PX4",
        {**BLIND, **PX4, "cap_s": 15.0},
        landed_blind(5.0, "Failsafe: no position, blind land"),
        apart=False,
        all_arrive=False,
    ),
    Row("GPS 2 m off", fault("gps_jump", for_s=3.0, offset=[2.0, 0.0, 0.0]), went_astray, apart=False),
    Row("GPS 5 m off", fault("gps_jump", for_s=3.0, offset=[0.0, 5.0, 0.0]), never_noticed),
    Row("GPS 5 m off for good", SHIFTED, believed_in_the_end, apart=False, all_arrive=False),
    Row("a rotor stops", fault("motor", rotor=0, left=0.0), flew_on_five),
    Row("clock 0.2 s late", late(200.0), understood),
    Row("clock 0.2 s early", late(-200.0), understood),
    Row("clock 5 s late", late(5_000.0), understood),
    Row("clock 5 s early", late(-5_000.0), understood),
    Row("a partition that heals", SIDES, cut_and_healed, apart=False),
    Row("lost in bursts", BURSTS, lost_in_a_row),
    Row("heard by none", one_way(sender=STRUCK), heard_by_none),
    Row("hears none", one_way(receiver=STRUCK), heard_none),
)


@pytest.mark.slow
@pytest.mark.parametrize("row", [pytest.param(row, id=row.name) for row in ROWS])
def test_a_fault(row: Row, tmp_path: Path) -> None:
    flown = fly(scenario("antipodal-8", SWAP, row.changes), 1, tmp_path)
    check_told(flown)
    summary = flown.summary
    there = arrived(flown)
    assert there.pop(K) is row.all_arrive
    assert all(there)
    assert summary["converged"] is row.all_arrive
    if row.apart:
        assert summary["d_min_violations"] == 0
    assert exit_status(summary) == (1 if summary["d_min_violations"] or not row.all_arrive else 0)
    if row.then is not None:
        row.then(flown)
