"""When the own state and the own plan are told to the others."""

from __future__ import annotations

import numpy as np
import pytest

from companion.config import CompanionConfig
from companion.estimation.tracks import State
from companion.telemetry.sharing import Sharing
from companion.values.horizon import roll_out
from companion.world import View
from mavlink_bridge.messages import GlobalPosition, Source, Tunnel
from outrider.scenarios.fly_config import RADIOS
from tests.companion.bench import FLEET, START

PERIOD, TICK = 100_000, 10_000


def told(later: int, last: int = 2_000_000, **rates: int) -> dict[int, set[type]]:
    """What is told up to ``last``, by its time after the first step, µs."""
    config = CompanionConfig.model_validate({"rates": {"plan_after_us": later, **rates}})
    sharing, found = Sharing(config, Source(11, 195), FLEET), {}
    view = View(State(np.array([1.0, 2.0, 3.0]), np.zeros(3), 0), 0.0, None, None)
    for since in range(0, last, TICK):
        now = START + since
        horizon = roll_out(now, config.horizon.dt_us, np.ones(3), np.zeros(3), np.zeros((16, 3)))
        if now >= sharing.next_due:
            said = {type(message) for message in sharing.due(now, view, horizon).swarm}
            if said := said & {GlobalPosition, Tunnel}:
                found[since] = said
    return found


def test_by_default_state_and_plan_go_together() -> None:
    together = {GlobalPosition, Tunnel}
    assert told(0) == dict.fromkeys(range(0, 2000000, PERIOD), together)


@pytest.mark.parametrize("later", [10_000, 50_000, 90_000])
def test_plans_that_are_told_later_have_datagrams_of_their_own(later: int) -> None:
    """No loss of one datagram takes both; each comes as often as before."""
    found = told(later)
    assert [since for since, said in found.items() if said == {GlobalPosition}] == [
        *range(0, 2_000_000, PERIOD)
    ]
    assert [since for since, said in found.items() if said == {Tunnel}] == [*range(later, 2_000_000, PERIOD)]
    assert len(found) == 40


def test_with_other_periods_than_those_of_states_few_plans_go_with_a_state() -> None:
    """The periods of the radio: of 27 states and 20 plans one of each is due together."""
    radio = RADIOS[57600]
    found = told(0, 10_800_000, state_us=radio.state_us, plan_us=radio.plan_us)
    assert sum(Tunnel in said for said in found.values()) == 20
    assert [since for since, said in found.items() if len(said) == 2] == [0]
