"""The backup node adds to the plan what its companion added."""

from __future__ import annotations

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as mavlink

from companion.avoidance.certified.committed import carried_on, committed, horizon_of, resting
from companion.config.flight import TrackingConfig
from companion.flight.autopilots import Profile
from companion.flight.autopilots.ardupilot import ARDUPILOT
from companion.flight.autopilots.px4 import PX4
from companion.flight.plan_feedforward import USUAL_DRAG, PlanFeedforward
from companion.values.horizon import Array
from mavlink_bridge.frames import enu_to_ned
from mavlink_bridge.messages import CommandLong, GpsGlobalOrigin, SetpointLocal
from tests.companion.backup_bench import (
    AUTOPILOT,
    BEGIN,
    COMPANION,
    CONFIG,
    DT,
    FLEET,
    STEPS,
    SYSTEM,
    TICK,
    YAW,
    Bench,
    told,
)


class Compensating(Bench):
    """The companion adds to its plan what the autopilot needs, and compensates drag and wind."""

    def __init__(self, profile: Profile) -> None:
        super().__init__(config=CONFIG.model_copy(update={"tracking": TrackingConfig(compensate=True)}))
        self.profile, self.autopilot, self.mode = profile, profile.autopilot, profile.guided_custom_mode
        self.feedforward = PlanFeedforward()

    def motion(self, now: int) -> tuple[Array, Array, Array]:
        """What a companion that goes on sends at ``now`` (µs), fleet-local ENU; call it in their order."""
        horizon, time, loop = horizon_of(self.plans[0]), now + CONFIG.setpoint_lead_us, self.profile.loop
        place, velocity, _ = horizon.at(time)
        added = self.feedforward.step(time, horizon.at, loop, USUAL_DRAG)
        drag = np.zeros(3) if loop.inverse is not None else [0.8, 0.8, 0.0] * velocity + [0.4, -0.3, 0.0]
        acceleration = horizon.at(time + loop.lead_us).acceleration
        return place, velocity + added.velocity, acceleration + added.acceleration + drag

    def _spoken(self) -> SetpointLocal:
        sent = (tuple(float(one) for one in enu_to_ned(part)) for part in self.motion(self.now))
        return SetpointLocal(COMPANION, self.now - BEGIN, SYSTEM, 1, 1, 0, *sent, YAW, 0.0)


@pytest.mark.parametrize("profile", [ARDUPILOT, PX4], ids=lambda profile: profile.name)
def test_it_adds_to_the_plan_what_the_companion_adds(profile: Profile) -> None:
    """The first set-points are those that the companion would have sent, and so are the later ones."""
    bench = Compensating(profile)
    assert bench.run(1.0) == []
    bench.speaks, since = False, bench.now
    sent = bench.run(2.0)
    wanted = {now: bench.motion(now) for now in range(since, bench.now, TICK)}
    plan = horizon_of(bench.plans[0])
    off, added = [], []
    for now, message in sent:
        place, velocity, acceleration = wanted[now]
        np.testing.assert_allclose(enu_to_ned(place), message.position, atol=1e-4)
        motion = plan.at(now + CONFIG.setpoint_lead_us)
        for sent_so, right, plain in (
            (message.velocity, velocity, motion.velocity),
            (message.acceleration, acceleration, motion.acceleration),
        ):
            off.append(np.abs(enu_to_ned(right) - sent_so).max())
            added.append(np.abs(right - plain).max())
    # The drag is known from a second of set-points, and not exactly.
    assert max(added) > 0.5
    assert max(off) < 0.25 * max(added)


@pytest.mark.parametrize("profile", [ARDUPILOT, PX4], ids=lambda profile: profile.name)
def test_another_command_or_origin_of_the_autopilot_discards_nothing_of_what_was_observed(
    profile: Profile,
) -> None:
    """A companion sends commands in flight, and an autopilot its origin whenever it is asked."""
    results = []
    for told_more in (False, True):
        bench = Compensating(profile)
        bench.run(1.0)
        if told_more:
            command = CommandLong(
                COMPANION, SYSTEM, 1, mavlink.MAV_CMD_REQUEST_MESSAGE, 0, (49.0, *(0.0,) * 6)
            )
            origin = GpsGlobalOrigin(AUTOPILOT, *FLEET.to_geodetic(np.zeros(3)), 0)
            for _ in range(2):
                bench.node.receive(bench.now, [command, origin])
        bench.speaks = False
        results.append(bench.run(0.5))
    assert results[0] == results[1] != []


def test_an_acceleration_that_is_no_number_is_not_continued() -> None:
    bench = Compensating(PX4)
    spoken = bench._spoken
    bench._spoken = lambda: spoken()._replace(acceleration=(float("nan"),) * 3)  # type: ignore[method-assign]
    bench.run(1.0)
    bench.speaks = False
    for _, message in bench.run(2.0):
        assert np.isfinite([*message.position, *message.velocity, *message.acceleration]).all()


def test_a_pause_of_the_companion_across_epochs_ends_nothing() -> None:
    """Plans arrive during the pause, and the one that was flown at its beginning is over at its end."""
    bench = Compensating(ARDUPILOT)
    bench.plans = [carried_on(bench.plans[0], k) for k in range(8)]
    assert bench.run(0.56) == []
    bench.speaks = False
    assert bench.run(0.07) == []
    # Then the epoch that began after 0.6 s is flown.
    (sent,) = bench.node.step(bench.now, [bench.tell("swarm", told(plan)) for plan in bench.plans])
    (message,) = bench.reader.feed(sent.data)
    assert isinstance(message, SetpointLocal)
    place, _, _ = bench.motion(bench.now)
    np.testing.assert_allclose(enu_to_ned(place), message.position, atol=1e-4)
    bench.now += TICK
    bench.speaks = True
    assert bench.run(1.0) == []


@pytest.mark.parametrize("profile", [ARDUPILOT, PX4], ids=lambda profile: profile.name)
def test_an_earlier_plan_that_arrives_later_ends_what_was_observed_before_it(profile: Profile) -> None:
    """A plan at rest was held before it began; then one arrives that begins sooner, and moves."""
    bench = Compensating(profile)
    rest = resting(BEGIN + 600_000, DT, STEPS, (1.0, 2.0, 5.0), FLEET.fingerprint)
    bench.plans = [rest]
    assert bench.run(0.26) == []
    moving = committed(rest._replace(epoch=BEGIN + 400_000), np.full((STEPS, 3), 0.2))
    bench.node.step(bench.now, [bench.tell("swarm", told(moving))])
    bench.speaks = False
    sent = bench.run(0.3)
    assert sent[0][0] == BEGIN + 400_000
    for time, message in sent:
        place = horizon_of(moving).at(time + CONFIG.setpoint_lead_us).position
        np.testing.assert_allclose(enu_to_ned(place), message.position, atol=1e-3)
