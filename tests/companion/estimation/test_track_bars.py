"""How well a track knows where its sender is when it is asked: a walker and a fast neighbour, over twenty
seeds."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from companion.config import CompanionConfig
from companion.config.estimation import TrackConfig
from companion.estimation.tracks import Track

SEEDS = 20
SECONDS = 40
STEP = 0.01
SETTLED = 30
"""Queries at 10 Hz that are left out at the beginning."""
BOOT = 7_000_123


class Report(NamedTuple):
    """A message: when it arrived (µs), its stamp (µs), position and velocity (3,)."""

    arrival: int
    stamp: int
    position: np.ndarray
    velocity: np.ndarray


def turning(random, speed, rates):
    """Positions and velocities (n, 3) at constant speed with the turn rates (n,) rad/s."""
    heading = random.uniform(0.0, 2.0 * np.pi) + STEP * np.cumsum(rates)
    velocity = speed * np.column_stack([np.cos(heading), np.sin(heading), np.zeros(len(rates))])
    return STEP * np.cumsum(velocity, axis=0), velocity


def walk(random):
    """1.5 m/s: straight for about six seconds, then a turn of up to 120° within 1.5 s, and so on."""
    rates = np.zeros(round(SECONDS / STEP))
    at = 0
    while at < len(rates):
        at += round(random.exponential(6.0) / STEP)
        rates[at : at + 150] = random.uniform(-1.0, 1.0) * np.radians(120.0) / 1.5
        at += 150
    return turning(random, 1.5, rates)


def weave(random):
    """5 m/s, always in a turn of up to 4 m/s², another one every two seconds or so."""
    rates = np.zeros(round(SECONDS / STEP))
    at = 0
    while at < len(rates):
        long = round(random.exponential(2.0) / STEP) + 1
        rates[at : at + long] = random.uniform(-4.0, 4.0) / 5.0
        at += long
    return turning(random, 5.0, rates)


def reports(random, path, period, delay, jitter, sigma, lost=0.0):
    """What arrives of a path, in the order of arrival: ``period``, ``delay``, ``jitter`` in ms, ``sigma`` of
    position and velocity on each axis. The sender's clock runs 30 ppm fast and tells whole milliseconds."""
    positions, velocities = path
    received = []
    for k in range(0, len(positions), round(period * 1e-3 / STEP)):
        if random.random() < lost:
            continue
        true = round(k * STEP * 1e6)
        arrival = true + round(1e3 * (delay + jitter * random.random()))
        stamp = (BOOT + round(true * 1.00003)) // 1000 * 1000
        z = positions[k] + sigma[0] * random.normal(size=3), velocities[k] + sigma[1] * random.normal(size=3)
        received.append(Report(arrival, stamp, *z))
    return sorted(received, key=lambda report: report.arrival)


def errors(config, received, positions):
    """Position errors (m, 3) when asked at 10 Hz."""
    track, waiting, found = Track(config), list(reversed(received)), []
    for k in range(0, len(positions), 10):
        now = round(k * STEP * 1e6)
        while waiting and waiting[-1].arrival <= now:
            report = waiting.pop()
            track.measure(report.arrival, report.position, report.velocity, report.stamp)
        state = track.at(now)
        if state is not None and k >= 10 * SETTLED:
            found.append(state.position - positions[k])
    return np.array(found)


def rmse(config, make, axes, **link):
    """Over all seeds, of the length of the error along ``axes``."""
    squares = []
    for seed in range(SEEDS):
        random = np.random.default_rng(seed)
        path = make(random)
        off = errors(config, reports(random, path, **link), path[0])[:, axes]
        squares.append(np.mean(np.einsum("ij,ij->i", off, off)))
    return float(np.sqrt(np.mean(squares)))


WALKER = {"period": 200, "delay": 200, "jitter": 0, "sigma": (1.0, 0.2), "lost": 0.2}
"""5 Hz; 1 m and 0.2 m/s on each axis, hence 1.4 m and 0.3 m/s over the ground; 200 ms late, a fifth lost."""
NEIGHBOUR = {"period": 100, "delay": 100, "jitter": 100, "sigma": (0.02, 0.05)}
"""10 Hz; 150 ± 50 ms late, so that messages overtake each other."""
OVER_GROUND, ALL = slice(0, 2), slice(0, 3)


def test_a_walker_is_known_to_40_cm():
    config = CompanionConfig().target.model_copy(update={"delay_us": 200_000})
    assert rmse(config, walk, OVER_GROUND, **WALKER) <= 0.40


def test_a_neighbour_at_5_m_s_is_known_to_12_cm():
    config = TrackConfig(delay_us=100_000)
    assert rmse(config, weave, ALL, **NEIGHBOUR) <= 0.12


def test_without_its_stamps_the_jitter_would_date_a_neighbour():
    """What the sender's clock is good for: by arrival alone, the mean delay known, it is twice as bad."""
    by_arrival = rmse(TrackConfig(delay_us=150_000, stamps=False), weave, ALL, **NEIGHBOUR)
    by_stamps = rmse(TrackConfig(delay_us=100_000), weave, ALL, **NEIGHBOUR)
    assert by_stamps < 0.6 * by_arrival


def test_a_delay_that_is_ignored_costs_what_it_is_worth():
    """100 ms at 5 m/s are half a metre."""
    ignored = rmse(TrackConfig(delay_us=0), weave, ALL, **NEIGHBOUR)
    assert 0.4 < ignored < 0.6
