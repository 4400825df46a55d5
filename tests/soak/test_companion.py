"""Damaged and absurd messages into a whole companion in flight: nothing raises, what it sends is finite and
within its limits, and good messages that follow put the picture right."""

from __future__ import annotations

from random import Random

import numpy as np
from pymavlink.dialects.v20 import all as mavlink

from companion.values.components import COMPONENT
from companion.values.phase import Phase
from mavlink_bridge.messages import CommandAck, CommandLong, GpsGlobalOrigin, Message, SetpointLocal
from mavlink_bridge.node import Datagram
from tests.companion.bench import (
    AUTOPILOT,
    FLEET,
    GROUND,
    LINKS,
    SYSTEM,
    TARGET,
    Bench,
    numbers_of,
    only,
    seen_at,
)
from tests.soak.campaigns import Mutant, Mutants
from tests.soak.corpora import Known, absurd_plan, frames, messages
from tests.soak.damage import WIRE_EDITS, absurd, damaged

OTHERS = frames(messages())
PLACE = np.array([4.0, 0.0, 0.0])
UNHEARD_OF = 31_000
"""A command that nobody knows."""
SINGLE = 1e-5
RECOVERY_S = 4.0


def in_flight(seed: int) -> Bench:
    """An escort or an own goal, on either autopilot, with sensors or without; the target is an obstacle."""
    flavour = ("ardupilot", "px4")[seed % 2]
    task = ("escort", "goto")[seed // 2 % 2]
    sensing = {"proximity": {}, "traffic": {}, "ground_messages": {"texts": True}} if seed // 4 % 2 else {}
    bench = Bench(flavour, task=task, target_d_min=1.0, target_d_safe=3.0, **sensing)
    bench.target = seen_at(TARGET, PLACE)
    return bench.take_off(5.0)


def datagram(random: Random, links: tuple[str, ...], now: int) -> Datagram:
    """A frame or some, absurd or damaged or both, by one of ``links``: as a rule where it belongs."""
    known = [one for one in messages(FLEET.checksum, now) if one.link in links]
    if "swarm" in links:
        known += [Known("swarm", absurd_plan(random, FLEET.fingerprint, now)) for _ in range(4)]
    one = random.choice(known)
    data = random.choice(frames([one]))
    if random.random() < 0.6:
        data = absurd(random, data)
    if random.random() < 0.3:
        data = damaged(random, data, OTHERS, WIRE_EDITS)
    link = one.link if random.random() < 0.9 else random.choice(links)
    return Datagram(link, data)


def fly_through(bench: Bench, session: list[Mutant], links: tuple[str, ...]) -> list[tuple[str, Message]]:
    """All that it sent while it heard the mutants of a session; every number finite."""
    sent = []
    bad = bench.companion.bad_frames
    for mutant in session:
        with mutant:
            random = mutant.random
            count = random.choice((1, 1, 2, 5))
            now = bench.step(*(datagram(random, links, bench.now) for _ in range(count)))
            now += bench.fly(random.choice((0.0, 0.01, 0.05)))
            for message in only(SetpointLocal, now):
                assert np.isfinite(numbers_of(message)).all()
            horizon = bench.companion.flown
            assert horizon is None or np.isfinite(horizon.knots).all()
            assert bench.companion.bad_frames >= bad
            bad = bench.companion.bad_frames
            sent += now
    return sent


def check_recovered(bench: Bench) -> None:
    """After some seconds of good messages it knows again where it and its target are, and answers."""
    origin = GpsGlobalOrigin(AUTOPILOT, FLEET.latitude, FLEET.longitude, FLEET.altitude, 0)
    bench.fly(RECOVERY_S / 2, bench.datagram("autopilot", origin))
    bad = bench.companion.bad_frames
    bench.fly(RECOVERY_S / 2)
    assert bench.companion.bad_frames == bad
    view = bench.companion.world.at(bench.now)
    assert view.own is not None
    assert view.own.age <= 100_000
    assert np.linalg.norm(view.own.position - bench.autopilot.position) < 0.2
    assert view.target is not None
    assert np.linalg.norm(view.target.position - PLACE) < 0.5
    order = CommandLong(GROUND, SYSTEM, COMPONENT, UNHEARD_OF, 0, (0.0,) * 7)
    # The first may be lost in what still waits of a broken frame.
    sent = [answer for _ in range(20) for answer in bench.step(bench.datagram("ground", order))]
    assert only(CommandAck, sent, "ground")[-1].result == mavlink.MAV_RESULT_UNSUPPORTED


def test_strangers_steer_nobody_beyond_the_limits(mutants: Mutants) -> None:
    """Whatever comes by the swarm and target links, set-points keep the limits and do not jump."""
    for session in mutants.sessions():
        bench = in_flight(session[0].index)
        sent = fly_through(bench, session, ("swarm", "target"))
        with session[-1]:
            found = only(SetpointLocal, sent)
            limits = bench.config.limits
            assert found
            velocity = np.array([m.velocity for m in found])
            assert (np.abs(velocity) <= max(limits.v_max) + 0.1).all()
            acceleration = np.linalg.norm([m.acceleration for m in found], axis=1)
            assert acceleration.max() <= limits.a_total + SINGLE
            steps = np.linalg.norm(np.diff([m.position for m in found], axis=0), axis=1)
            seconds = np.diff([m.time_boot for m in found]) * 1e-6
            assert (steps <= seconds * (np.linalg.norm(limits.v_max) + 0.1) + 0.01).all()
            assert only(CommandLong, sent) == []
            assert bench.phase is Phase.ESCORT
            check_recovered(bench)


def test_whatever_anybody_says_is_survived(mutants: Mutants) -> None:
    """On all links, also in the name of the own autopilot and of the operator."""
    for session in mutants.sessions():
        bench = in_flight(session[0].index)
        fly_through(bench, session, LINKS)
        with session[-1]:
            check_recovered(bench)
