"""The stages of a flight, led by what is seen of it: when the clock starts, what counts as converged, when it
ends."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as mavlink

from companion.avoidance.certified.margins import between
from companion.values.components import COMPONENT
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import CommandAck, Source
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec
from outrider.runs.ground_truth import SAMPLE
from outrider.scenarios.companion_settings import settings_of
from outrider.scenarios.scenario import Scenario
from outrider.scenarios.starts import starts
from outrider.simulation.conductor import HOLD, Conductor, Observation, Stage
from outrider.simulation.operator import LINK, Operator
from tests.outrider.shipped import scenario

EPOCH = 1_000_000
FLEET = FleetFrame(47.397742, 8.545594, 488.0)
AIRBORNE = scenario("antipodal-8", vehicles=2, airborne=True, cap_s=10.0)
GROUNDED = scenario("antipodal-8", vehicles=2, cap_s=10.0)


class Run:
    """A conductor that is shown a sight every 20 ms."""

    def __init__(self, of: Scenario) -> None:
        self.starts = starts(of, 1, False)
        self.operator = Operator(FLEET)
        self.conductor = Conductor(of, self.starts, self.operator, EPOCH)
        self.now = EPOCH
        self.target = np.zeros(3)

    def show(
        self, seconds: float, positions: Any, speed: float = 0.0, *, ready: bool = True, armed: bool = True
    ) -> bool:
        over = False
        for _ in range(round(seconds * 1e6 / SAMPLE)):
            self.now += SAMPLE
            velocities = np.zeros((len(positions), 3))
            velocities[0, 0] = speed
            waiting = () if ready else ("companion-11 waits for a heartbeat",)
            sight = Observation(
                self.now, np.asarray(positions), velocities, self.target, ready, waiting, armed
            )
            over = self.conductor.see(sight)
            if over:
                break
        return over

    def orders(self) -> set[int]:
        """Commands that the operator has open."""
        return {command for _, command in self.operator._open}


def test_the_clock_starts_when_all_have_hovered_for_a_while() -> None:
    run = Run(GROUNDED)
    there = run.starts.positions
    run.show(5.0, there, ready=False)
    run.show(2.0, there, speed=0.2)
    assert run.conductor.stage is Stage.PREPARE
    run.show(0.4, there)
    run.show(0.1, there, speed=0.2)
    run.show(0.5, there)
    assert run.conductor.stage is Stage.PREPARE
    run.show(0.1, there)
    assert run.conductor.stage is Stage.CLOCK
    assert run.conductor.clock_start is not None
    assert EPOCH < run.conductor.clock_start <= run.now


def test_converged_is_near_and_slow_and_both_for_a_second() -> None:
    run = Run(AIRBORNE)
    goals = run.starts.goals
    assert goals is not None
    run.show(1.0, run.starts.positions)
    assert run.conductor.stage is Stage.CLOCK
    run.show(0.9, goals)
    run.show(0.1, goals, speed=0.31)
    run.show(0.9, goals + np.array([0.0, 0.0, 0.29]))
    run.show(0.1, goals + np.array([0.0, 0.0, 0.31]))
    assert run.conductor.converged_at is None
    began = run.now + SAMPLE
    assert run.show(20.0, goals + np.array([0.29, 0.0, 0.0]), speed=0.29)
    assert run.conductor.converged_at == began
    assert run.conductor.clock_end == began + HOLD + 5_000_000
    assert run.conductor.failure is None


def test_others_converge_without_those_whose_companion_ends_for_good() -> None:
    faults = [{"kind": "vanish", "vehicle": 12, "at_s": 1.0}]
    run = Run(scenario("antipodal-8", vehicles=2, airborne=True, cap_s=10.0, faults=faults))
    assert run.starts.goals is not None
    run.show(1.0, run.starts.positions)
    places = np.array([run.starts.goals[0], run.starts.positions[1]])
    began = run.now + SAMPLE
    assert run.show(20.0, places)
    assert run.conductor.others_converged_at == began
    assert run.conductor.converged_at is None
    # The first companion lasts: while its vehicle is away, nobody has arrived.
    run = Run(run.conductor._scenario)
    run.show(1.0, run.starts.positions)
    assert run.show(20.0, run.starts.positions)
    assert run.conductor.others_converged_at is None


def _of_three() -> tuple[Scenario, float]:
    """Three vehicles of which the companion of the second ends after 1 s, and the least distance of plans."""
    faults = [{"kind": "vanish", "vehicle": 12, "at_s": 1.0}]
    certified = {"avoidance": "certified"}
    changes = {"vehicles": 3, "airborne": True, "cap_s": 10.0, "faults": faults, "companion": certified}
    of = scenario("antipodal-8", **changes, sensors="rtk")
    config = settings_of(of)
    least = between(config.certified, config.field, config.limits)
    return of, least


def _silent_beside_a_goal(off: float) -> tuple[Run, Any, Any, float]:
    """The run of three after 1 s, their goals, where the silent one rests, and the least distance of plans.

    It rests ``off`` m east of the goal of the third, and 1 m higher.
    """
    of, least = _of_three()
    run = Run(of)
    goals = run.starts.goals
    assert goals is not None
    run.show(1.0, run.starts.positions)
    return run, goals, goals[2] + [off, 0.0, 1.0], least


def test_a_goal_where_a_vehicle_rests_whose_companion_has_ended_is_counted_and_not_waited_for() -> None:
    of, least = _of_three()
    for off, covered in ((least - 0.31, 1), (least - 0.29, 0)):
        run = Run(of)
        starts, goals = run.starts.positions, run.starts.goals
        assert goals is not None
        run.show(1.0, starts)
        # The third vehicle cannot get nearer than 0.3 m to its goal, in the first case.
        places = np.array([goals[0], goals[2] + [off, 0.0, 0.0], goals[2] + [off, least, 0.0]])
        run.show(1.4, places)
        assert run.conductor.covered == 0
        assert run.show(20.0, places)
        assert run.conductor.covered == covered
        assert run.conductor.others_converged_at is None
        start = run.conductor.clock_start
        assert start is not None
        # It has rested for a second since the end of its companion.
        assert run.conductor.able_converged_at == (start + 2_000_000 if covered else None)


def test_a_vehicle_whose_goal_is_covered_has_arrived_where_it_rests_as_near_to_it_as_it_can() -> None:
    for further, arrived in ((0.2, True), (0.4, False)):
        run, goals, silent, least = _silent_beside_a_goal(0.4)
        # Heights do not count: nobody flies over the silent vehicle, nor under it.
        third = goals[2] - [least - 0.4 + further, 0.0, 0.0]
        run.show(20.0, [goals[0], silent, third])
        assert run.conductor.covered == 1
        assert (run.conductor.others_converged_at is not None) == arrived
        assert run.conductor.converged_at is None


def test_a_gust_does_not_uncover_a_goal() -> None:
    run, goals, silent, _ = _silent_beside_a_goal(0.4)
    run.show(3.0, [goals[0], silent, run.starts.positions[2]])
    assert run.conductor.covered == 1
    pushed = silent + np.array([3.0, 0.0, 0.0])
    run.show(1.0, [goals[0], pushed, run.starts.positions[2]])
    assert run.conductor.covered == 1


def test_a_companion_that_restarts_is_given_the_go_and_the_goal_again() -> None:
    faults = [{"kind": "restart", "vehicle": 12, "at_s": 1.0, "for_s": 0.5}]
    run = Run(scenario("antipodal-8", vehicles=2, airborne=True, cap_s=10.0, faults=faults))
    run.show(1.0, run.starts.positions)
    run.operator._open.clear()
    run.show(0.9, run.starts.positions)
    assert run.orders() == set()
    run.show(0.2, run.starts.positions)
    assert run.orders() == {22, 192}


def test_who_does_not_converge_is_flown_to_the_cap() -> None:
    run = Run(AIRBORNE)
    assert run.show(30.0, run.starts.positions)
    assert run.conductor.converged_at is None
    assert run.conductor.clock_start is not None
    assert run.conductor.clock_end == run.conductor.clock_start + 10_000_000


@pytest.mark.parametrize(("ends_at", "lasts"), [(1.0, 7.0), (3.0, 9.0), (29.0, 35.0), (100.0, 30.0)])
def test_the_arrival_of_the_others_ends_a_flight_but_not_before_the_last_companion_has_ended(
    ends_at: float, lasts: float
) -> None:
    """An end after the time limit of 30 s does not count: the limit ends the flight."""
    faults = [{"kind": "vanish", "vehicle": 12, "at_s": ends_at}]
    changes = {"vehicles": 2, "airborne": True, "cap_s": 30.0, "faults": faults}
    run = Run(scenario("antipodal-8", **changes, arrival="others"))
    goals = run.starts.goals
    assert goals is not None
    run.show(1.0, run.starts.positions)
    assert run.show(60.0, np.array([goals[0], run.starts.positions[1]]))
    conductor = run.conductor
    assert conductor.converged_at is None
    assert conductor.clock_start is not None
    assert conductor.clock_end is not None
    seconds = 1e-6 * (conductor.clock_end - conductor.clock_start)
    assert seconds == pytest.approx(lasts, abs=1e-6)


def test_after_the_clock_all_are_told_to_land_unless_they_began_in_the_air() -> None:
    run = Run(GROUNDED)
    assert not run.show(15.0, run.starts.positions)
    assert run.conductor.stage is Stage.LAND
    assert run.orders() >= {21}
    assert run.show(1.0, run.starts.positions, armed=False)
    assert run.conductor.failure is None
    run = Run(AIRBORNE)
    run.show(15.0, run.starts.positions)
    assert 21 not in run.orders()


@pytest.mark.parametrize(
    ("ready", "said"), [(False, "waits for a heartbeat"), (True, "do not come to a hover")]
)
def test_who_never_hovers_is_brought_down_and_it_is_said_why(ready: bool, said: str) -> None:
    run = Run(GROUNDED)
    run.show(91.0, run.starts.positions, speed=1.0, ready=ready)
    assert run.conductor.stage is Stage.LAND
    assert said in (run.conductor.failure or "")
    assert run.conductor.clock_start is None


def test_who_does_not_land_is_not_waited_for_for_ever() -> None:
    run = Run(GROUNDED)
    assert run.show(90.0, run.starts.positions)
    assert "not all vehicles were down" in (run.conductor.failure or "")


def test_a_goal_that_a_companion_refuses_is_the_failure() -> None:
    run = Run(AIRBORNE)
    run.show(2.0, run.starts.positions)
    denied = CommandAck(Source(12, COMPONENT), 192, mavlink.MAV_RESULT_DENIED, 0, 0, 255, 190)
    run.operator.step(run.now, [Datagram(LINK, Codec().encode(denied))])
    assert run.conductor.failure is None
    assert run.show(20.0, run.starts.positions)
    assert run.starts.goals is not None
    east, north, up = run.starts.goals[1]
    said = f"vehicle 12 refused the goal ({east:.3f}, {north:.3f}, {up:.3f}) m"
    assert run.conductor.failure == said


def test_an_abort_lands_and_keeps_the_first_reason() -> None:
    run = Run(GROUNDED)
    run.show(2.0, run.starts.positions)
    run.conductor.abort(run.now, "interrupted")
    run.conductor.abort(run.now, "again")
    assert run.conductor.stage is Stage.LAND
    assert run.conductor.failure == "interrupted"
    assert run.conductor.clock_end == run.now
    assert run.show(1.0, run.starts.positions, armed=False)


def test_only_after_the_last_jump_of_the_target_can_it_be_converged() -> None:
    of = scenario(
        "scenario-1",
        vehicles=2,
        airborne=True,
        target={"jumps": [{"after_s": 4.0, "to": [0.0, 0.0, 0.0]}]},
    )
    run = Run(of)
    on_circle = np.array([[4.0, 0.0, 5.0], [-4.0, 0.0, 5.0]])
    run.show(3.0, on_circle)
    assert run.conductor.stage is Stage.CLOCK
    assert run.conductor.converged_at is None
    run.show(4.0, on_circle)
    assert run.conductor.converged_at is not None
    assert run.conductor.clock_start is not None
    assert run.conductor.converged_at - run.conductor.clock_start == pytest.approx(4_000_000, abs=SAMPLE)
