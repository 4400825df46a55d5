"""How much each camera counts for where vehicles place themselves: by what it sees, not by what is lost."""

from __future__ import annotations

import numpy as np
import pytest

from companion.config import CompanionConfig
from companion.estimation.fused_target import FusedTarget
from tests.companion.estimation.cameras import FLEET, START, message, source_of
from tests.companion.estimation.sightings import (
    NEIGHBOUR,
    OTHER,
    OWN,
    PLACE,
    forwarded,
    give,
    heard,
    own_detection,
    started,
)


def lossy(share: float, vehicles=(11, 12, 13, 14), blind=(), seconds: float = 30.0, since: float = 10.0):
    """Yield the weights that vehicle 11 measures, each tenth of a second from 10 s on.

    It receives its own detections, and detections and positions of the other ``vehicles`` with the
    probability ``share``, each datagram by itself; the vehicles ``blind`` see nothing from ``since`` (s) on.
    """
    source = source_of("truth")
    config = CompanionConfig.model_validate({"target": {"rewind_us": 2_000_000}})
    of, random = FusedTarget(config, source, OWN, FLEET), np.random.default_rng(8)
    cameras = {
        system: np.array([6.0 * np.cos(1.57 * k), 6.0 * np.sin(1.57 * k), 5.0])
        for k, system in enumerate(vehicles)
    }
    for tick in range(round(10.0 * seconds)):
        now = START + 100_000 * tick
        for system, camera in cameras.items():
            sent = message(system, PLACE, camera)
            if system != OWN and random.uniform() <= share:
                of.heard(now, sent.source, now - START + 1)
            if system != OWN and random.uniform() > share:
                continue
            if system not in blind or tick <= 10.0 * since:
                of.receive(now, now - 60_000, tuple(camera), None, sent)
        if tick > 100:
            yield of.sight(now, 1.0).weights


@pytest.mark.parametrize("vehicles", [(11, 12, 13, 14), (11, 12)], ids=len)
def test_a_camera_counts_though_most_of_its_messages_are_lost(vehicles):
    """Over two seconds, nine of ten lost, one of eight cameras would count as one that sees nothing."""
    full = next(iter(lossy(1.0, vehicles)))
    found = np.array(
        [[weights.get(system, 0.0) / full[system] for system in full] for weights in lossy(0.1, vehicles)]
    )
    assert np.mean(found > 0.2) > 0.995
    assert np.mean(found) > 0.85


def test_a_camera_that_sees_nothing_counts_for_nothing():
    found = lossy(1.0, blind={13}, since=-1.0)
    assert all(13 not in weights and len(weights) == 3 for weights in found)


BLIND = {
    "one of two": ((11, 12), {12}),
    "one of three": ((11, 12, 13), {12}),
    "both others": ((11, 12, 13), {12, 13}),
}


@pytest.mark.parametrize(("vehicles", "blind"), BLIND.values(), ids=BLIND.keys())
@pytest.mark.parametrize(("share", "seconds"), [(1.0, 2.5), (0.8, 4.0), (0.1, 17.0)])
def test_a_camera_that_becomes_blind_soon_counts_for_nothing(vehicles, blind, share, seconds):
    """Without lost messages after the base span of two seconds, whoever else sees."""
    before, *found = lossy(share, vehicles, blind, 10.0 + seconds + 5.0, since=10.0)
    assert set(before) == set(vehicles)
    assert all(set(weights) == set(vehicles) - blind for weights in found[round(10.0 * seconds) :])


def test_a_camera_behind_a_worse_link_counts_as_much():
    """Nine of ten messages of vehicle 12 are lost, none of 13: compared in number, 12 would see little."""
    source = source_of("truth")
    config = CompanionConfig.model_validate({"target": {"rewind_us": 2_000_000}})
    of, random, found = FusedTarget(config, source, OWN, FLEET), np.random.default_rng(8), []
    for tick in range(300):
        now = START + 100_000 * tick
        for system, share in ((11, 1.0), (12, 0.1), (13, 1.0)):
            sent = message(system, PLACE, OTHER)
            if random.uniform() <= share:
                of.heard(now, sent.source, now - START + 1)
            if random.uniform() <= share:
                of.receive(now, now - 60_000, tuple(OTHER), None, sent)
        weights = of.sight(now, 1.0).weights
        if tick > 100:
            found.append(weights.get(12, 0.0) / weights[13])
    assert np.min(found) > 0.5
    assert np.mean(found) > 0.95


def test_positions_of_the_fleet_tell_that_a_neighbour_is_heard():
    """The whole way, by messages: a neighbour that reports its position and no detection does not see."""
    of, now = started()
    for tick in range(100):
        now += 100_000
        heard(of, now)
        give(of, now, "autopilot", own_detection(now - START - 150_000))
        if tick < 50:
            give(of, now, "swarm", forwarded(now - START - 60_000))
        if tick == 49:
            assert set(of.sight(now, 1.0).weights) == {OWN, NEIGHBOUR}
        if tick == 80:
            assert set(of.sight(now, 1.0).weights) == {OWN}
