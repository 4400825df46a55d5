"""A vehicle whose steps miss the end of its epochs states no agreement on a plan that it has not sent."""

from __future__ import annotations

import numpy as np
import pytest

from mavlink_bridge.messages import Tunnel
from mavlink_bridge.wire.agreements import PAYLOAD_TYPE as AGREEMENTS
from mavlink_bridge.wire.agreements import unpack as unpack_statement
from mavlink_bridge.wire.plan import unpack as unpack_plan
from tests.companion.avoidance.certified.plans import DT, EPOCH
from tests.companion.avoidance.certified.rough import Habits, Rough
from tests.companion.avoidance.certified.swarm import Swarm
from tests.companion.avoidance.certified.vehicle import Vehicle

LENGTH, UNTIL = DT, 8_000_000
LATE = tuple((k * LENGTH + 120_000, (k + 1) * LENGTH + 180_000) for k in range(1, UNTIL // LENGTH, 2))
"""Not called from before the time at which a plan is made until the last call of the next epoch."""


class Recorded(Swarm):
    """Keeps the order in which each vehicle sends."""

    def _carry(self, since: int, vehicle: Vehicle, message: Tunnel) -> None:
        self.told.setdefault(vehicle.system, []).append(message)
        super()._carry(since, vehicle, message)

    @property
    def told(self) -> dict[int, list[Tunnel]]:
        found: dict[int, list[Tunnel]] = self.__dict__.setdefault("_told", {})
        return found


@pytest.mark.parametrize("seed", range(1, 5))
def test_every_agreement_that_is_stated_is_on_a_plan_that_was_sent(seed: int) -> None:
    starts = np.array([[0.0, 0.0, 5.0], [8.0, 0.0, 5.0], [4.0, 7.0, 5.0]])
    rough = Rough(loss=0.2, delay=60_000)
    swarm = Recorded(starts, rough, [Habits(frozen=LATE), Habits(), Habits(frozen=LATE)], seed)
    swarm.run(UNTIL, lambda _since, system: starts[system % 3])
    stated, carried = 0, 0
    for system, messages in swarm.told.items():
        sent: set[int] = set()
        for message in messages:
            if message.payload_type == AGREEMENTS:
                named = {own for e in unpack_statement(message.payload).entries for own, _ in e.agreements}
                assert named <= sent
                stated += len(named)
            else:
                sent.add(unpack_plan(message.payload).epoch)
        begun = range(min(sent), EPOCH + UNTIL - LENGTH, LENGTH)
        carried += system != 2 and len(set(begun) - sent)
    assert stated > 100
    # There were epochs without a plan of their own.
    assert carried > 0
    assert swarm.parted == []
