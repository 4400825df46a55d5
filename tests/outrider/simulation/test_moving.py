"""Moving obstacles: what their nodes say is how they move, and a scenario knows who they are."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from companion.obstacles.moving import MovingObstacles
from companion.telemetry.sharing import plan_message
from mavlink_bridge.frames import FleetFrame, ned_to_enu
from mavlink_bridge.messages import GlobalPosition, Message, Source, Tunnel
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.plan import KNOTS, unpack
from outrider.realtime.spawn import rough
from outrider.runs import names
from outrider.runs.ground_truth import GroundTruth, Limits
from outrider.scenarios.moving import MovingPostPart, MovingSpherePart
from outrider.scenarios.scenario import Scenario
from outrider.simulation.fleet import Fleet
from outrider.simulation.moving import STEP, MovingObstacle, places
from outrider.simulation.paths import ClosedPath
from tests.outrider.shipped import FIREFLY, LOGS, scenario
from tests.outrider.ways import bent_ring

FLEET = FleetFrame(47.4, 8.5, 488.0)
START = 1_767_225_600_000_000
TICK = 10_000
LAWS = settings(deadline=None, max_examples=25)
WAYS = st.integers(3, 8).flatmap(lambda n: st.integers(0, 2**32 - 1).map(lambda seed: bent_ring(n, seed)))
ROUND = ((6.0, 0.0), (0.0, 6.0), (-6.0, 0.0), (0.0, -6.0))
POST: dict[str, Any] = {"kind": "post", "radius": 0.4, "through": ROUND, "speed": 1.0}
SPHERE: dict[str, Any] = {
    "kind": "sphere",
    "radius": 0.6,
    "through": [(*place, 5.0) for place in ROUND],
    "speed": 1.5,
}


def sphere(way: np.ndarray, speed: float = 1.5, **more: Any) -> MovingObstacle:
    config = MovingSpherePart.model_validate({**SPHERE, "through": way.tolist(), "speed": speed, **more})
    return MovingObstacle(config, 190, FLEET)


def said(node: MovingObstacle, seconds: float, begin: float) -> list[tuple[int, Message]]:
    """What it says, and when; it sets out at ``begin`` (s)."""
    codec = Codec()
    received = []
    for now in range(START, START + round(1e6 * seconds), TICK):
        if now == START + round(1e6 * begin):
            node.begin(now)
        for datagram in node.step(now, [Datagram("swarm", b"whatever")]):
            assert datagram.link == "swarm"
            received += [(now, message) for message in codec.feed(datagram.data)]
    return received


# The node


@LAWS
@given(WAYS, st.floats(0.2, 3.0), st.sampled_from([1.0, 5.0, 10.0]), st.booleans())
def test_it_says_where_it_is_at_its_stamp(way: np.ndarray, speed: float, rate: float, plans: bool) -> None:
    node = sphere(way, speed, rate_hz=rate, shares_plan=plans)
    received = said(node, 4.0, begin=1.0)
    positions = [(now, m) for now, m in received if isinstance(m, GlobalPosition)]
    assert [now - START for now, _ in positions] == [round(k * 1e6 / rate) for k in range(round(4 * rate))]
    assert {m.source for _, m in received} == {Source(190, 1)}
    assert sum(isinstance(m, Tunnel) for _, m in received) == plans * len(positions)
    for now, message in positions:
        assert message.time_boot == now - START
        there = FLEET.to_enu(message.latitude, message.longitude, message.altitude)
        np.testing.assert_allclose(there, node.motion(now).position, atol=0.02)
        np.testing.assert_allclose(
            ned_to_enu(message.velocity_ned), node.motion(now).velocity, atol=0.011 * np.sqrt(3.0)
        )


@LAWS
@given(WAYS, st.floats(0.2, 3.0), st.integers(0, 20_000_000))
def test_the_velocity_is_the_derivative_of_the_position(way: np.ndarray, speed: float, since: int) -> None:
    node = sphere(way, speed)
    node.begin(START)
    h, now = 500, START + since
    before, after = node.motion(max(now - h, START)), node.motion(now + h)
    slope = (after.position - before.position) / (1e-6 * (now + h - max(now - h, START)))
    np.testing.assert_allclose(slope, node.motion(now).velocity, atol=0.02 * speed + 1e-3)


@LAWS
@given(WAYS, st.floats(0.2, 2.0), st.integers(0, 20_000_000))
def test_its_plan_is_where_it_will_be(way: np.ndarray, speed: float, since: int) -> None:
    """Over the wire and back, at its knots and between them."""
    node = sphere(way, speed)
    node.begin(START)
    now = START + since // 4 * 4
    horizon = node.horizon(now)
    message = plan_message(horizon, Source(190, 1), FLEET)
    assert message is not None
    plan = unpack(message.payload)
    assert plan.epoch == now
    for n, position in enumerate(plan.positions_m()):
        np.testing.assert_allclose(position, node.motion(now + n * STEP).position, atol=0.02)
    for part in range(0, KNOTS * STEP, 37_000):
        np.testing.assert_allclose(
            horizon.at(now + part).position, node.motion(now + part).position, atol=0.02
        )


def test_it_stands_until_the_goal_event_and_then_sets_out() -> None:
    node = sphere(bent_ring(5, 1), 2.0, setting_out=0.5)
    received = said(node, 8.0, begin=2.0)
    positions = [(now, message) for now, message in received if isinstance(message, GlobalPosition)]
    speeds = {now - START: np.linalg.norm(message.velocity_ned) for now, message in positions}
    assert {speeds[k * 100_000] for k in range(21)} == {0.0}
    assert speeds[4_000_000] == pytest.approx(1.0, abs=0.02)
    assert speeds[7_900_000] == pytest.approx(2.0, abs=0.02)


@LAWS
@given(WAYS, st.lists(st.integers(0, 60_000_000), min_size=1, max_size=5))
def test_many_instants_are_as_one_by_one(way: np.ndarray, times: list[int]) -> None:
    nodes = [sphere(way), sphere(-way, 0.7)]
    for node in nodes:
        node.begin(START + 5_000_000)
    found = places(nodes, [START + time for time in times])
    assert found.shape == (len(times), 2, 3)
    for row, time in zip(found, times, strict=True):
        for place, node in zip(row, nodes, strict=True):
            np.testing.assert_allclose(place, node.motion(START + time).position, atol=1e-9)
    assert places([], times).shape == (len(times), 0, 3)


@pytest.mark.parametrize("way", [[(1.0, 2.0, 3.0)] * 3, [(0.0, 0.0, 1.0), (4.0, 0.0, 1.0), (8.0, 0.0, 1.0)]])
def test_a_way_that_is_no_round_is_gone_all_the_same(way: list[Any]) -> None:
    """A place, and a line to and fro."""
    node = sphere(np.array(way), shares_plan=True)
    for now, message in said(node, 20.0, begin=0.0):
        if isinstance(message, GlobalPosition):
            assert np.isfinite(node.motion(now).velocity).all()
    assert np.isfinite(ClosedPath(np.array(way)).at(0.0, 1.0).velocity).all()


# The scenario


def traffic(*moving: dict[str, Any], **changes: Any) -> Scenario:
    return scenario("scenario-1", moving=moving, **changes)


def beside(system: int) -> dict[str, Any]:
    """What a file may say of an obstacle that it does not fly."""
    return {"companion": {"moving": [{"system": system, "kind": "sphere", "radius": 1.0}]}}


def test_a_scenario_with_them_survives_a_round_trip() -> None:
    of = traffic(POST, {**SPHERE, "shares_plan": True, "rate_hz": 5.0, "setting_out": 0.5})
    assert Scenario.model_validate_json(of.model_dump_json(), strict=True) == of
    assert Scenario.model_validate(of.model_dump()) == of
    assert isinstance(of.moving[0], MovingPostPart)
    assert list(of.moving_systems) == [190, 191]


def test_companions_know_what_it_flies_and_what_it_says_beside() -> None:
    known = {"system": 77, "kind": "sphere", "radius": 2.0}
    of = traffic(POST, SPHERE, companion={"moving": [known]}, bystanders=[{"at": [0.0, 9.0, 5.0]}])
    fleet = Fleet(of, FIREFLY, 1, LOGS)
    told = fleet.companion_config_of(0).moving
    assert [(one.system, one.kind, one.radius) for one in told] == [
        (77, "sphere", 2.0),
        (190, "post", 0.4),
        (191, "sphere", 0.6),
    ]
    assert fleet.companion_config_of(of.vehicles).moving == ()
    assert [node.system for node in fleet.moving()] == [190, 191]


@pytest.mark.parametrize(
    ("moving", "changes", "said"),
    [
        ([{**POST, "kind": "wall"}], {}, "'sphere', 'post'"),
        ([{**POST, "through": ROUND[:2]}], {}, "at least 3"),
        ([{**POST, "height": 0.0}], {}, "greater than 0"),
        ([{**POST, "through": SPHERE["through"]}], {}, "through"),
        ([{**SPHERE, "speed": 0.0}], {}, "greater than 0"),
        ([{**SPHERE, "height": 3.0}], {}, "not permitted"),
        ([POST], {"vehicles": 180}, "with moving obstacles at most 179 are allowed"),
        ([POST], beside(190), r"companion.moving\[0\].system = 190 is the id of moving\[0\]"),
        ([POST], beside(12), "12 is the id of a vehicle of the fleet"),
        ([], beside(10), "10 is the id of the target"),
        ([], beside(255), "less than or equal to 254"),
        ([POST], {"links": {"swarm": {"directions": [{"sender": 191}]}}}, "neither a vehicle"),
    ],
)
def test_what_cannot_be_is_refused(moving: list[Any], changes: dict[str, Any], said: str) -> None:
    with pytest.raises(ValidationError, match=said):
        traffic(*moving, **changes)


def test_a_recorded_target_cannot_be_one_of_them() -> None:
    with pytest.raises(ValidationError, match=r"target.system = 190 is the id of moving\[0\]"):
        scenario("escort", moving=[POST], target={"system": 190})


def test_they_are_heard_on_the_swarm_link_with_faults_of_their_own() -> None:
    lossy = {"directions": [{"sender": "moving", "loss": 0.5}, {"sender": 191, "loss": 0.9}]}
    of = traffic(POST, SPHERE, vehicles=2, links={"swarm": lossy})
    channels = {channel.name: channel for channel in Fleet(of, FIREFLY, 1, LOGS).channels()}
    assert {name for name, c in channels.items() if names.moving(190) in c.members} == {"swarm"}
    swarm = channels["swarm"]
    assert swarm.between("moving-190", "companion-11").loss == 0.5
    assert swarm.between("moving-191", "companion-12").loss == 0.9
    assert swarm.between("companion-12", "companion-11").loss == 0.0


def test_in_real_time_they_come_through_the_companion_s_own_ether() -> None:
    fleet = Fleet(traffic(POST, vehicles=2), FIREFLY, 1, LOGS)
    (node,) = fleet.moving()
    behind = rough(fleet, fleet.companion(0, lambda: 0, 0), {"swarm": None})
    behind.step(START, node.step(START, []))
    assert behind.network.counters.sent == 1
    behind.step(START + 1_000_000, [])
    assert behind.network.counters.delivered == 1


# The truth


def test_who_comes_too_near_to_one_is_counted() -> None:
    """A vehicle hovers at 5 m; a ball passes with its surface at 0.3 m, and a post 1 m below."""
    known = traffic(SPHERE, {**POST, "height": 4.0}).moving_known
    truth = GroundTruth(1, Limits(0.5, None, 0.5), None, MovingObstacles(known))
    steps = 2_500e-6 * np.arange(1, 1601).reshape(-1, 8)
    for k, times in enumerate(steps):
        ball = np.stack([2.0 * times - 4.0, np.full(8, 0.9), np.full(8, 5.0)], axis=1)
        post = np.stack([2.0 * times - 4.0, np.zeros(8), np.zeros(8)], axis=1)
        track = np.broadcast_to([0.0, 0.0, 5.0], (8, 1, 3))
        truth.take(20_000 * k, track, np.zeros((1, 17)), np.zeros((8, 3)), np.stack([ball, post], axis=1))
    assert truth.obstacles.minimum == pytest.approx(0.3)
    assert truth.obstacles.count == 1
    samples = truth.samples()
    assert samples.moving.shape == (200, 2, 3)
    np.testing.assert_allclose(samples.moving[:, 0, 0], 2.0 * steps[:, -1] - 4.0)
    assert truth.samples(10**9).moving.shape == (0, 2, 3)
