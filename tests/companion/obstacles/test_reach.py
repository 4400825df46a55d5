"""Where a neighbour may be that was not heard, and that two that fly at each other keep apart by it.

With losses of their own in each direction no violation was found. Overtaking is not among these flights.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from companion.config import CompanionConfig
from companion.obstacles.reach import Reach
from companion.obstacles.unheard import Heard, Unheard
from companion.values.speed_bounds import Slowing

CONFIG = CompanionConfig.model_validate({"task": "goto", "guard": {"unheard_us": 1_000}})
"""Everybody counts as unheard: there is no field here that keeps those who are heard apart."""
D_MIN, PERIOD, STEPS = CONFIG.field.d_min, 50_000, 16
MANY = settings(deadline=None, max_examples=8)
"""Each is a flight of some seconds."""


class Flier:
    """A vehicle that flies where it wants, as fast as the rule lets it, and hears what is not lost."""

    def __init__(self, place, others, planned=False):
        self.rule = Unheard(CONFIG)
        self.slowing = Slowing(0.1, CONFIG.limits.a_total, None)
        self.place, self.velocity, self.acceleration = np.array(place), np.zeros(3), np.zeros(3)
        self.states, self.times = np.zeros((others, 6)), np.zeros(others, dtype=np.int64)
        self.planned = np.full(others, planned)

    def hears(self, other, now, row):
        self.states[row, :3], self.states[row, 3:], self.times[row] = other.place, other.velocity, now

    def bounds(self, now):
        return self.rule.bounds(now, Heard(now - self.times, self.states, self.planned), self.place)

    def gaps(self, now):
        """What it takes for the gaps; its own place as it is."""
        bounds = self.bounds(now)
        return None if bounds is None else bounds.gaps

    def replan(self, now, wish):
        bounds = self.bounds(now)
        a = np.tile((wish - self.velocity) / 0.5, (STEPS, 1))
        a *= np.minimum(CONFIG.limits.u_max[0] / np.maximum(np.linalg.norm(a, axis=1), 1e-9), 1.0)[:, None]
        if bounds is not None:
            self.slowing.keep(self.place, self.velocity, self.acceleration, 0.05, bounds, a)
        self.acceleration = a[0]

    def move(self):
        step = 1e-6 * PERIOD
        self.place = self.place + step * self.velocity + 0.5 * step**2 * self.acceleration
        self.velocity = self.velocity + step * self.acceleration


def together(count, radius, loss, seed, seconds):
    """Least distance of vehicles on a ring that want to be on the other side, and of what each knew."""
    chance = np.random.default_rng(seed)
    angles = 2.0 * np.pi * np.arange(count) / count
    ring = radius * np.stack([np.cos(angles), np.sin(angles), np.zeros(count)], axis=1)
    fliers = [Flier(place, count - 1) for place in ring]
    # Each hears each with a loss of its own: some not at all.
    losses = np.clip(chance.choice([loss, 1.0], size=(count, count), p=[0.8, 0.2]), 0.0, 1.0)
    least, beyond = np.inf, 0.0
    for now in range(1_000_000, 1_000_000 + seconds * 1_000_000, PERIOD):
        for own, flier in enumerate(fliers):
            rest = [other for k, other in enumerate(fliers) if k != own]
            for row, other in enumerate(rest):
                first = now == 1_000_000
                if first or (now % 100_000 == 0 and chance.random() > losses[own, fliers.index(other)]):
                    flier.hears(other, now, row)
        for own, flier in enumerate(fliers):
            wish = 5.0 * (-ring[own] - flier.place) / max(np.linalg.norm(-ring[own] - flier.place), 1.0)
            flier.replan(now, wish + chance.normal(size=3))
        for flier in fliers:
            flier.move()
        places = np.array([flier.place for flier in fliers])
        apart = np.linalg.norm(places[:, None] - places[None], axis=2)
        least = min(least, apart[~np.eye(count, dtype=bool)].min())
        for own, flier in enumerate(fliers):
            known = flier.gaps(now + PERIOD)
            if known is not None and len(known) == count - 1:
                truth = np.delete(apart[own], own) - D_MIN
                beyond = max(beyond, float((known - np.maximum(truth, 0.0)).max()))
    return least, beyond


@MANY
@given(seed=st.integers(0, 2**32 - 1), loss=st.sampled_from([0.5, 0.9, 0.97, 1.0]), count=st.integers(2, 3))
@example(seed=755_341, loss=0.9, count=2)
def test_vehicles_that_fly_at_each_other_do_not_meet_with_losses_of_their_own(seed, loss, count):
    """In each direction a loss of its own, and some hear one of the others not at all."""
    least, beyond = together(count, 7.0, loss, seed, 10)
    assert least > D_MIN
    # Nobody was nearer than the other one's bound for it, but for what both fly in a step.
    assert beyond < 0.01


def test_a_place_just_heard_is_no_larger_than_its_error():
    reach = Reach(2.0, 1.6, 8.0)
    radii = reach.grown(0, np.array([0, 0]), np.zeros(2), np.array([5.0, 5.0]), np.array([0.0, 0.3]))
    assert radii.tolist() == [0.0, 0.3]


def test_it_grows_as_fast_as_one_may_come_and_never_up_to_the_own_place():
    reach, none = Reach(2.0, 1.6, 8.0), np.zeros(1)
    reach.grown(0, np.array([0]), none, np.array([1.5]), none)
    last = 0.0
    for now in range(50_000, 15_000_000, 50_000):
        radius = float(reach.grown(now, np.array([now]), none, np.array([1.5]), none)[0])
        # dR/dt = (1.5 − R)/T.
        assert radius == pytest.approx(1.5 * (1.0 - np.exp(-1e-6 * now / 1.6)), abs=0.05)
        assert last < radius < 1.5
        last = radius


def test_one_that_was_fast_is_taken_to_brake_and_one_far_off_to_be_as_fast_as_it_can():
    reach, none = Reach(2.0, 1.6, 8.0), np.zeros(2)
    speeds, distances = np.array([4.0, 0.0]), np.array([0.1, 1000.0])
    for now in range(0, 3_050_000, 50_000):
        radii = reach.grown(now, np.array([now, now]), speeds, distances, none)
    assert radii[0] == pytest.approx(4.0, abs=0.2)
    assert radii[1] == pytest.approx(8.0 * 3.0, abs=0.5)


@MANY
@given(
    apart=st.floats(0.05, 0.5),
    planned=st.booleans(),
    losses=st.tuples(*[st.sampled_from([0.0, 0.9, 1.0])] * 2),
    seed=st.integers(0, 2**32 - 1),
)
def test_two_inside_d_min_part(apart, planned, losses, seed):
    """Whether they hear each other or not, after a first silence; and they come no nearer if they want to."""
    chance = np.random.default_rng(seed)
    side = chance.normal(size=3)
    side *= apart / np.linalg.norm(side)
    for sign in (1.0, -1.0):
        pair = [Flier(-0.5 * side, 1, planned), Flier(0.5 * side, 1, planned)]
        least = apart
        for own, other in zip(pair, pair[::-1], strict=True):
            own.hears(other, 900_000, 0)
        for now in range(1_000_000, 6_000_000, PERIOD):
            for own, other, loss in zip(pair, pair[::-1], losses, strict=True):
                if now > 1_000_000 and now % 100_000 == 0 and chance.random() >= loss:
                    own.hears(other, now, 0)
            away = sign * 3.0 * side / apart
            for own, wish in zip(pair, (-away, away), strict=True):
                own.replan(now, wish)
            for own in pair:
                own.move()
            least = min(least, float(np.linalg.norm(pair[0].place - pair[1].place)))
        assert least > apart - 1e-6
        if sign > 0.0:
            # From where hardly anything lacks they move hardly further than d_min.
            parted = np.linalg.norm(pair[0].place - pair[1].place)
            assert parted > (D_MIN + 0.1 if apart < D_MIN - 0.01 else D_MIN - 1e-6)


def test_a_state_that_becomes_older_again_is_as_uncertain_as_any_of_its_age():
    """A plan that ceases to count leaves the position of before it."""
    none, at = np.zeros(1), np.array([12.0])
    ages = np.array([2_500_000])
    reach, anew = Reach(2.0, 1.6, 8.0), Reach(2.0, 1.6, 8.0)
    reach.grown(1_000_000, np.array([900_000]), none, np.array([11.5]), np.array([0.3]))
    expected = anew.grown(1_050_000, ages, none, at, none)
    assert expected[0] > 5.0
    assert reach.grown(1_050_000, ages, none, at, none) == pytest.approx(expected)


def test_the_radius_of_a_neighbour_just_heard_again_is_its_error():
    reach, none = Reach(2.0, 1.6, 8.0), np.zeros(1)
    for now in range(0, 2_050_000, 50_000):
        reach.grown(now, np.array([now]), none, np.array([9.0]), none)
    assert reach.grown(2_100_000, np.array([0]), none, np.array([9.0]), none)[0] == 0.0
