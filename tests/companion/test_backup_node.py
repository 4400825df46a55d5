"""The backup node sends nothing while its companion does, and the committed plan when that falls silent."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink

from companion.avoidance.certified.agreements import Agreements
from companion.avoidance.certified.committed import carried_on, committed, horizon_of, resting
from companion.avoidance.certified.fingerprint import fingerprint, identity
from companion.avoidance.certified.negotiation import Geometry
from companion.avoidance.certified.separating_planes import AGREED
from companion.backup_node import BackupNode
from companion.config import CompanionConfig
from companion.config.flight import TrackingConfig
from companion.flight.autopilots import Profile
from companion.flight.autopilots.ardupilot import ARDUPILOT
from companion.flight.autopilots.px4 import PX4
from companion.flight.plan_feedforward import USUAL_DRAG, PlanFeedforward
from companion.values.components import COMPONENT
from companion.values.horizon import Array
from mavlink_bridge.frames import FleetFrame, enu_to_ned
from mavlink_bridge.key import Key
from mavlink_bridge.messages import (
    CommandLong,
    GpsGlobalOrigin,
    Heartbeat,
    Message,
    SetpointLocal,
    Source,
    Tunnel,
)
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.agreements import PAYLOAD_TYPE as AGREEMENTS
from mavlink_bridge.wire.agreements import Entry, Statement
from mavlink_bridge.wire.agreements import pack as pack_statement
from mavlink_bridge.wire.agreements import unpack as unpack_statement
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.plan import PAYLOAD_TYPE, WirePlan, pack, quantise
from mavlink_bridge.wire.plan import unpack as unpack_plan
from mavlink_bridge.wire.signing import Signing

SYSTEM = 11
FLEET = FleetFrame(47.397742, 8.545594, 488.0)
CONFIG = CompanionConfig.model_validate(
    {"task": "goto", "avoidance": "certified", "certified": {"dt_us": 200_000, "epoch_us": 200_000}}
)
DT, STEPS, TICK = 200_000, 16, 10_000
BEGIN = 1_767_225_600_000_000
AUTOPILOT, COMPANION = Source(SYSTEM, 1), Source(SYSTEM, COMPONENT)
YAW = 0.7


class Bench:
    """A backup node, and a companion that speaks until it is told not to."""

    def __init__(
        self, key: Key | None = None, companions: Key | None = None, config: CompanionConfig = CONFIG
    ) -> None:
        """``key``: the backup node's; ``companions``: its companion's, and the autopilot's."""
        self.node = BackupNode(config, SYSTEM, FLEET, None if key is None else Signing(key))
        signing = Signing(companions)
        signing.present(BEGIN)
        self.codec, self.reader = Codec(None, signing), Codec()
        self.now = BEGIN
        self.speaks = self.beats = True
        self.autopilot, self.mode, self.armed = ARDUPILOT.autopilot, mavlink.COPTER_MODE_GUIDED, True
        self.origin = np.zeros(3)
        """Of the vehicle's local frame, as the backup node hears it; the companion's is the fleet's."""
        self.ahead = 0
        """µs by which the companion's clock is ahead of the backup node's."""
        self.plans = [plan_from(BEGIN)]
        self.height: float | None = None
        """Height (m) of the companion's set-points; None: that of the plan."""
        self.east = 0.0
        """Distance (m) of the companion's set-points east of the plan."""
        self.sent: list[tuple[int, SetpointLocal]] = []

    def run(self, seconds: float) -> list[tuple[int, SetpointLocal]]:
        """Go on for so long; what the backup node sent meanwhile."""
        before = len(self.sent)
        for _ in range(round(seconds * 1e6 / TICK)):
            for link, data in self.node.step(self.now, self._inbox()):
                assert link == "autopilot"
                for message in self.reader.feed(data):
                    if isinstance(message, SetpointLocal):
                        self.sent.append((self.now, message))
                    else:
                        assert isinstance(message, Heartbeat)
            self.now += TICK
        return self.sent[before:]

    def tell(self, link: str, message: Message) -> Datagram:
        return Datagram(link, self.codec.encode(message))

    def _inbox(self) -> list[Datagram]:
        since, inbox = self.now - BEGIN, []
        if since == 0:
            latitude, longitude, altitude = FLEET.to_geodetic(self.origin)
            origin = GpsGlobalOrigin(AUTOPILOT, latitude, longitude, altitude, 0)
            inbox.append(self.tell("autopilot", origin))
        if self.beats and since % 1_000_000 == 0:
            custom = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
            base = custom | mavlink.MAV_MODE_FLAG_SAFETY_ARMED * self.armed
            inbox.append(self.tell("autopilot", Heartbeat(AUTOPILOT, 13, self.autopilot, base, self.mode, 4)))
        if self.speaks and since % 20_000 == 0:
            inbox.append(self.tell("autopilot", self._spoken()))
        if self.speaks and since % 50_000 == 0:
            inbox += [self.tell("swarm", told(plan)) for plan in self.plans]
        return inbox

    def _spoken(self) -> SetpointLocal:
        """What the companion sends: its plan, by its own clock."""
        now = self.now + self.ahead
        begun = [plan for plan in self.plans if plan.epoch <= now]
        # Before its first plan begins it holds the place where that begins; without a plan it flies another.
        first = self.plans[0] if self.plans else plan_from(BEGIN)
        plan = max(begun, default=first, key=lambda one: one.epoch)
        place = horizon_of(plan).at(now + CONFIG.setpoint_lead_us).position
        place[0] += self.east
        if self.height is not None:
            place[2] = self.height
        ned, zero = (float(place[1]), float(place[0]), -float(place[2])), (0.0, 0.0, 0.0)
        return SetpointLocal(COMPANION, self.now - BEGIN, SYSTEM, 1, 1, 0, ned, zero, zero, YAW, 0.0)


def plan_from(epoch: int, seed: int = 1) -> WirePlan:
    random = np.random.default_rng(seed)
    start = quantise(epoch, DT, [1.0, 2.0, 5.0], [1.5, -0.5, 0.1], np.zeros((STEPS, 3)), FLEET.fingerprint)
    return committed(start, random.uniform(-1.0, 1.0, (STEPS, 3)))


def told(plan: WirePlan, source: Source = COMPANION) -> Tunnel:
    return Tunnel(source, 0, 0, PAYLOAD_TYPE, pack(plan))


def silent(bench: Bench) -> Bench:
    """After a second of talk the companion is silent."""
    assert bench.run(1.0) == []
    bench.speaks = False
    return bench


def hovering(column: bool) -> Bench:
    """The companion hovers over its place, at another height than its plan."""
    bench = Bench()
    plan = resting(BEGIN, DT, STEPS, (1.0, 2.0, 0.1), FLEET.fingerprint, column=column)
    bench.plans = [plan, plan._replace(epoch=BEGIN + 200_000)]
    bench.height = 5.0
    return silent(bench)


def test_a_column_goes_on_at_the_height_of_the_last_set_point() -> None:
    """After a climb the plan is a column of the ground's height, until it becomes a plan in space."""
    bench = hovering(column=True)
    sent = bench.run(2.0)
    assert len(sent) > 80
    for _, message in sent:
        np.testing.assert_allclose(message.position, (2.0, 1.0, -5.0), atol=1e-4)
        np.testing.assert_allclose(message.velocity, 0.0, atol=1e-6)
    assert [unpack_plan(one.payload).column for one in bench.node.farewell(bench.now)[:1]] == [True]


@pytest.mark.parametrize(("column", "height"), [(False, 5.0), (True, float("nan"))])
def test_a_set_point_at_another_height_agrees_with_no_plan_in_space_and_a_nan_with_none(
    column: bool, height: float
) -> None:
    bench = hovering(column)
    bench.speaks, bench.height = True, height
    bench.run(0.1)
    bench.speaks = False
    assert bench.run(2.0) == []
    assert bench.node.farewell(bench.now) == []


@pytest.mark.parametrize(("east", "flies"), [(0.25, True), (0.35, False)])
@pytest.mark.parametrize("height", [0.1, 0.35, 5.0])
def test_only_the_horizontal_distance_of_a_set_point_from_a_column_counts(
    height: float, east: float, flies: bool
) -> None:
    """The plan's height is 0.1 m."""
    bench = hovering(column=True)
    bench.speaks, bench.height, bench.east = True, height, east
    bench.run(0.1)
    bench.speaks = False
    sent = bench.run(1.0)
    assert bool(sent) is flies
    for _, message in sent:
        np.testing.assert_allclose(message.position, (2.0, 1.0, -height), atol=1e-4)


@pytest.mark.parametrize("up", [0.0, 0.35])
def test_a_column_that_still_moves_vertically_is_flown_at_the_heights_of_its_plan(up: float) -> None:
    """It is made of a plan in space."""
    bench = Bench()
    bench.plans = [plan_from(BEGIN)._replace(column=True)]
    assert bench.run(1.0) == []
    place = horizon_of(bench.plans[0]).at(bench.now + CONFIG.setpoint_lead_us).position
    bench.height = float(place[2]) + up
    bench.run(0.02)
    bench.speaks = False
    sent = bench.run(1.0)
    assert bool(sent) is (up == 0.0)
    for time, message in sent:
        planned = horizon_of(bench.plans[0]).at(time + CONFIG.setpoint_lead_us).position
        assert -message.position[2] == pytest.approx(planned[2], abs=2e-3)


def test_a_column_that_becomes_a_plan_in_space_is_flown_at_the_plans_height() -> None:
    bench = hovering(column=True)
    begins = bench.now + 100_000 - bench.now % 200_000 + 200_000
    bench.plans = [resting(begins, DT, STEPS, (1.0, 2.0, 5.2), FLEET.fingerprint)]
    for plan in bench.plans:
        bench.node.step(bench.now, [bench.tell("swarm", told(plan))])
    bench.run(0.6)
    assert -bench.sent[-1][1].position[2] == pytest.approx(5.2, abs=1e-4)


def test_while_the_companion_speaks_it_is_silent() -> None:
    assert Bench().run(5.0) == []


def test_it_sends_the_committed_plan_to_its_end_and_some_seconds_of_hover() -> None:
    bench = silent(Bench())
    sent = bench.run(30.0)
    since = sent[0][0] - bench.now + round(30.0 * 1e6)
    assert since <= 120_000
    horizon = horizon_of(bench.plans[0])
    assert abs(sent[-1][0] - horizon.end - CONFIG.certified.backup_hover_us) <= TICK
    times = [time for time, _ in sent]
    assert set(np.diff(times)) == {CONFIG.rates.setpoint_us}
    for time, message in sent:
        motion = horizon.at(time + CONFIG.setpoint_lead_us)
        east_north_up = np.array([message.position[1], message.position[0], -message.position[2]])
        np.testing.assert_allclose(east_north_up, motion.position, atol=2e-3)
        velocity = np.array([message.velocity[1], message.velocity[0], -message.velocity[2]])
        np.testing.assert_allclose(velocity, motion.velocity, atol=1e-5)
        assert message.source == Source(SYSTEM, 191)
        assert (message.target_system, message.type_mask) == (SYSTEM, 0)
        assert message.yaw == pytest.approx(YAW, abs=1e-3)


def test_the_newest_plan_that_has_begun_is_flown() -> None:
    """Both that the companion has told: the next one from its epoch on."""
    bench = Bench()
    bench.plans = [plan_from(BEGIN + 800_000), plan_from(BEGIN + 1_200_000, 2)]
    assert bench.run(1.0) == []
    bench.speaks = False
    for time, message in bench.run(1.0):
        chosen = bench.plans[time >= BEGIN + 1_200_000]
        assert message.position[1] == pytest.approx(
            horizon_of(chosen).at(time + CONFIG.setpoint_lead_us).position[0], abs=2e-3
        )


def test_when_the_companion_is_back_it_is_silent_again() -> None:
    bench = silent(Bench())
    assert bench.run(1.0)
    bench.speaks = True
    bench.run(0.02)
    assert bench.run(3.0) == []


@pytest.mark.parametrize("how", ["another mode", "disarmed", "no heartbeat"])
def test_a_vehicle_that_somebody_else_has_is_left_alone(how: str) -> None:
    bench = silent(Bench())
    assert bench.run(0.5)
    bench.mode = mavlink.COPTER_MODE_LOITER if how == "another mode" else mavlink.COPTER_MODE_GUIDED
    bench.armed = how != "disarmed"
    bench.beats = how != "no heartbeat"
    # A heartbeat is a second old at most; without any it counts for three.
    bench.run(3.1)
    assert bench.run(2.0) == []
    # Given back, it is at nobody's plan: the old one would be somewhere else.
    bench.mode, bench.armed, bench.beats = mavlink.COPTER_MODE_GUIDED, True, True
    assert bench.run(3.0) == []


def test_what_the_companion_does_not_fly_is_not_carried_on() -> None:
    """Another clock, origin or plan: then the backup node does not know what the others rely on."""
    late, elsewhere, other = Bench(), Bench(), Bench()
    late.ahead = 1_500_000
    elsewhere.origin = np.array([0.5, 0.0, 0.0])
    for bench in (late, elsewhere):
        assert silent(bench).run(3.0) == []
    other.run(1.0)
    # The last set-point is of a plan that was never told.
    strange = SetpointLocal(COMPANION, 0, SYSTEM, 1, 1, 0, (9.0, 9.0, -5.0), (0.0,) * 3, (0.0,) * 3, YAW, 0.0)
    other.node.step(other.now, [other.tell("autopilot", strange)])
    other.speaks = False
    assert other.run(3.0) == []


def test_a_plan_of_another_time_is_none() -> None:
    bench = Bench()
    bench.plans = [plan_from(BEGIN + 60_000_000), plan_from(BEGIN - 60_000_000)]
    assert silent(bench).run(3.0) == []


def test_after_an_order_to_land_it_is_silent() -> None:
    """It goes out before the farewell, and before the autopilot says that it has left the mode."""
    bench = Bench()
    bench.run(1.0)
    land = CommandLong(COMPANION, SYSTEM, 1, mavlink.MAV_CMD_NAV_LAND, 0, (0.0,) * 7)
    bench.node.step(bench.now, [bench.tell("autopilot", land)])
    bench.speaks = False
    assert bench.run(3.0) == []


def test_after_a_farewell_it_is_silent() -> None:
    """The companion lands: no set-point may come in between."""
    bench = Bench()
    bench.run(1.0)
    bench.node.step(bench.now, [bench.tell("swarm", stated(farewell=True))])
    bench.speaks = False
    assert bench.run(3.0) == []


def stated(source: Source = COMPANION, *, farewell: bool = False) -> Tunnel:
    """A statement of the companion's agreements."""
    said = Statement(
        fingerprint(CONFIG, FLEET), BEGIN, BEGIN, (Entry(12, ((BEGIN, BEGIN),), (BEGIN, BEGIN)),), farewell
    )
    return Tunnel(source, 0, 0, AGREEMENTS, pack_statement(said))


def test_its_farewell_is_accepted_by_the_others_with_which_there_was_an_agreement() -> None:
    """Also by one that heard nothing before, seconds after the plan was made."""
    bench = Bench()
    bench.run(1.0)
    assert bench.plans[-1].epoch < bench.now
    bench.node.step(bench.now, [bench.tell("swarm", stated())])
    bench.speaks = False
    bench.run(9.0)
    for system, since, expected in ((12, BEGIN, True), (12, BEGIN + 1_000_000, False), (13, BEGIN, False)):
        # The second has begun anew since, and the third has never agreed: this farewell may be an old one.
        assert accepted(bench, system, since) is expected


def starting(place: tuple[float, float, float], height: float | None = None) -> Bench:
    """A companion that announced its first plan, held ``place``, and ended before this plan began.

    With a ``height`` (m) it is a column, held at that height.
    """
    bench = Bench()
    begins, bench.height = BEGIN + 800_000, height
    bench.plans = [resting(begins, DT, STEPS, place, FLEET.fingerprint, column=height is not None)]
    assert bench.run(0.3) == []
    said = Statement(
        fingerprint(CONFIG, FLEET), begins, begins, (Entry(12, ((begins, begins),), (begins, begins)),)
    )
    bench.node.step(
        bench.now, [bench.tell("swarm", Tunnel(COMPANION, 0, 0, AGREEMENTS, pack_statement(said)))]
    )
    bench.speaks = False
    return bench


def test_a_first_plan_at_rest_is_held_before_it_begins_and_is_the_last_one() -> None:
    """The others may have agreed on it, and would wait for a farewell for ever."""
    bench = starting((1.0, 2.0, 5.0))
    held = bench.run(0.4)
    assert held
    assert all(np.allclose(sent.position, (2.0, 1.0, -5.0), atol=1e-3) for _, sent in held)
    assert bench.node.farewell(bench.now) == [], "the plan has not begun by the clocks of all"
    bench.run(1.0)
    assert accepted(bench, 12, BEGIN + 800_000)


def test_a_first_column_is_held_at_the_height_of_the_last_set_point_before_it_begins() -> None:
    bench = starting((1.0, 2.0, 5.0), height=3.5)
    held = bench.run(1.4)
    assert held[0][0] < BEGIN + 800_000 < held[-1][0]
    for _, sent in held:
        np.testing.assert_allclose(sent.position, (2.0, 1.0, -3.5), atol=1e-3)
    assert accepted(bench, 12, BEGIN + 800_000)


def test_a_first_plan_at_rest_after_an_order_to_land_is_held_before_it_begins() -> None:
    """The plans of before are discarded, so that it is the earliest one; the vehicle holds its place."""
    bench = Bench()
    bench.run(0.5)
    order = CommandLong(COMPANION, SYSTEM, 1, mavlink.MAV_CMD_NAV_LAND, 0, (0.0,) * 7)
    begins = BEGIN + 1_300_000
    bench.plans = [resting(begins, DT, STEPS, (4.0, 2.0, 5.0), FLEET.fingerprint)]
    bench.node.step(bench.now, [bench.tell("autopilot", order)])
    assert bench.run(0.3) == []
    bench.speaks = False
    held = bench.run(0.4)
    assert held[-1][0] < begins
    for _, sent in held:
        np.testing.assert_allclose(sent.position, (2.0, 4.0, -5.0), atol=1e-3)


@pytest.mark.parametrize(("moves", "east"), [(0.5, 0.0), (0.0, 0.5)])
def test_a_first_plan_that_moves_or_is_elsewhere_is_not_held(moves: float, east: float) -> None:
    bench = Bench()
    bench.east = east
    plan = resting(BEGIN + 800_000, DT, STEPS, (1.0, 2.0, 5.0), FLEET.fingerprint, column=False)
    bench.plans = [committed(plan, np.full((STEPS, 3), moves))]
    bench.run(0.3)
    bench.speaks = False
    assert bench.run(2.0) == []
    assert bench.node.farewell(bench.now) == []


def test_its_farewell_is_accepted_by_others_whose_plans_it_has_received_since() -> None:
    bench = Bench()
    bench.run(1.0)
    bench.node.step(bench.now, [bench.tell("swarm", stated())])
    bench.speaks = False
    bench.run(9.0)
    now, stray = bench.now, plan_from(bench.now + 1_000_000)
    newest = plan_from(now, seed=2)
    for plan in (newest, newest._replace(epoch=now - 400_000), stray):
        bench.node.hear(now, [told(plan, Source(12, COMPONENT)), told(plan, Source(SYSTEM, COMPONENT))])
    bench.node.hear(now, [told(newest._replace(origin=newest.origin ^ 1), Source(13, COMPONENT))])
    assert accepted(bench, 12, now)
    assert not accepted(bench, 12, now + 200_000)
    assert not accepted(bench, 13, BEGIN)
    bench.node.hear(now, [told(newest, Source(13, COMPONENT))])
    assert accepted(bench, 13, BEGIN)


def accepted(bench: Bench, system: int, since: int) -> bool:
    """Whether ``system``, which begins at ``since`` (µs), accepts the backup node's farewell now."""
    certified, known = CONFIG.certified, identity(CONFIG, FLEET)
    agreements = Agreements(
        system,
        certified,
        STEPS,
        known,
        Geometry(lambda *_: True, lambda *_: np.zeros((STEPS + 1, AGREED))),
    )
    agreements.begin(since)
    agreements.made(plan_from(since, seed=2))
    for message in bench.node.farewell(bench.now):
        assert isinstance(message, Tunnel)
        if message.payload_type == PAYLOAD_TYPE:
            agreements.receive_plan(bench.now, SYSTEM, message.payload)
        else:
            agreements.receive_statement(bench.now, SYSTEM, unpack_statement(message.payload))
    if SYSTEM not in agreements.left:
        return False
    end = horizon_of(bench.plans[-1]).at(bench.now).position
    assert np.allclose(agreements.left[SYSTEM].controls[-1, 2], end, atol=1e-9)
    return True


def test_statements_without_a_farewell_and_those_of_others_change_nothing() -> None:
    bench = Bench()
    bench.run(1.0)
    others = stated(Source(12, COMPONENT), farewell=True)
    garbage = stated()._replace(payload=b"\x01\x01")
    for message in (stated(), others, garbage):
        bench.node.step(bench.now, [bench.tell("swarm", message)])
    bench.speaks = False
    assert bench.run(3.0)


def test_another_companions_plan_is_not_flown() -> None:
    bench = Bench()
    bench.plans = []
    for source in (Source(12, COMPONENT), Source(SYSTEM, 1)):
        bench.node.step(bench.now, [bench.tell("swarm", told(plan_from(BEGIN), source))])
    assert silent(bench).run(3.0) == []


@given(st.lists(st.tuples(st.sampled_from(["autopilot", "swarm"]), st.binary(max_size=300)), max_size=6))
def test_garbage_is_harmless(garbage: list[tuple[str, bytes]]) -> None:
    bench = silent(Bench())
    bench.node.step(bench.now, [Datagram(link, data) for link, data in garbage])
    assert bench.run(0.5)


KEY = Key.of_passphrase("correct horse")


def test_with_the_same_key_it_carries_on_as_without_any():
    sent = []
    for key in (None, KEY):
        bench = Bench(key, key)
        bench.run(1.0)
        bench.speaks = False
        sent.append(bench.run(1.0))
    assert sent[0] == sent[1] != []


def test_with_another_key_it_hears_nobody_and_carries_nothing_on():
    bench = Bench(KEY, None)
    bench.run(1.0)
    bench.speaks = False
    assert bench.run(2.0) == []


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
