"""The truth: encounters are counted once, at every physics step, and samples are those of the physics."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from mavlink_bridge.frames import FleetFrame, ned_to_enu
from mavlink_bridge.node import Datagram
from outrider.runs.ground_truth import SAMPLE, Encounters, GroundTruth, Limits
from outrider.scenarios.scenario import FixedTarget
from outrider.simulation.targets import StandingTarget
from outrider.simulation.truth_observer import MotionObserver, TruthObserver
from sitl.config.autopilot import AutopilotConfig
from sitl.node import Autopilot
from sitl.vehicle.multirotor import Reference, VehicleState
from tests.outrider.shipped import FIREFLY

NAN = float("nan")
LEAST = 0.5
MIDDLE = 0.5025
"""s; a physics step, but not the last one of a tick of 5 ms."""
FLEET = FleetFrame(47.397742, 8.545594, 488.0)

# Encounters


@pytest.mark.parametrize(
    ("distances", "count", "minimum"),
    [
        ([2.0, 1.0, 2.0], 0, 1.0),
        ([2.0, 0.4, 2.0], 1, 0.4),
        ([2.0, 0.4, 0.3, 0.2, 0.4, 2.0], 1, 0.2),
        ([0.4, 2.0, 0.4, 2.0], 2, 0.4),
        ([0.4], 1, 0.4),
        ([LEAST, LEAST], 0, LEAST),
        ([NAN, NAN], 0, float("inf")),
        ([NAN, 0.4, NAN], 1, 0.4),
        ([0.4, NAN, 0.4], 1, 0.4),
        ([0.4, NAN, 2.0, 0.4], 2, 0.4),
        ([], 0, float("inf")),
    ],
)
def test_one_stay_below_is_one_encounter(distances: list[float], count: int, minimum: float) -> None:
    seen = Encounters(1, LEAST)
    seen.see(np.array(distances).reshape(-1, 1))
    assert (seen.count, seen.minimum) == (count, minimum)


def test_pairs_are_counted_apart() -> None:
    seen = Encounters(3, LEAST)
    seen.see(np.array([[1.0, 0.4, NAN], [0.4, 0.4, NAN], [1.0, 1.0, 0.4], [0.4, NAN, 0.4]]))
    assert (seen.count, seen.minimum) == (4, 0.4)


DISTANCES = st.integers(1, 4).flatmap(
    lambda pairs: hnp.arrays(
        np.float64,
        st.tuples(st.integers(0, 12), st.just(pairs)),
        elements=st.sampled_from([NAN, 0.0, 0.2, 0.4999, 0.5, 0.7, 3.0]),
    )
)


def naive(distances: np.ndarray) -> int:
    """Counted one pair and one instant at a time."""
    total = 0
    for column in distances.T:
        inside = False
        for distance in column:
            if not np.isnan(distance):
                total += bool(distance < LEAST) and not inside
                inside = bool(distance < LEAST)
    return total


@given(DISTANCES, st.lists(st.integers(0, 12), max_size=4))
def test_the_count_does_not_depend_on_how_time_is_cut(distances: np.ndarray, cuts: list[int]) -> None:
    seen = Encounters(distances.shape[1], LEAST)
    for part in np.split(distances, sorted(min(cut, len(distances)) for cut in cuts)):
        seen.see(part)
    assert seen.count == naive(distances)
    finite = distances[np.isfinite(distances)]
    assert seen.minimum == (finite.min() if len(finite) else float("inf"))


@given(DISTANCES)
def test_the_count_is_the_same_backwards_and_in_any_order_of_pairs(distances: np.ndarray) -> None:
    counts = []
    for same in (distances, distances[::-1], distances[:, ::-1]):
        seen = Encounters(distances.shape[1], LEAST)
        seen.see(same)
        counts.append((seen.count, seen.minimum))
    assert len(set(counts)) == 1


def test_a_single_vehicle_meets_nobody() -> None:
    seen = Encounters(0, LEAST)
    seen.see(np.empty((5, 0)))
    assert (seen.count, seen.minimum) == (0, float("inf"))


# Sampling


class OnRails:
    """Stands in for an autopilot whose vehicle moves as ``path`` says: ENU (m) of time (s)."""

    def __init__(self, path: Any, *, airborne: bool = True, reference: bool = True) -> None:
        self._path = path
        self._referenced = reference
        self.airborne = airborne
        self.estimate_error = np.zeros(3)
        self.trace = np.empty((0, 3))
        self.trace_times = np.empty(0, dtype=np.int64)
        self.moved_to = 0

    def move(self, begin: int, end: int, step: int = 2_500) -> None:
        self.trace_times, self.moved_to = np.arange(begin + step, end + 1, step), end
        self.trace = ned_to_enu([self._path(time * 1e-6) for time in self.trace_times]).reshape(-1, 3)

    @property
    def state(self) -> VehicleState:
        zero = np.zeros(3)
        return VehicleState(
            position=self.trace[-1],
            velocity=np.array([0.0, 1.0, 0.0]),
            attitude=np.array([1.0, 0.0, 0.0, 0.0]),
            body_rates=zero,
            rotor_speeds=np.zeros(6),
            acceleration=zero,
        )

    @property
    def reference(self) -> Reference | None:
        return Reference.hover(self.trace[-1], 0.0) if self._referenced else None


def truth(vehicles: Sequence[OnRails], d_min_target: float | None = None) -> GroundTruth:
    return GroundTruth(len(vehicles), Limits(LEAST, d_min_target))


class Observer:
    """Both observers of a flight in one process."""

    def __init__(self, vehicles: Sequence[Any], target: StandingTarget, truth: GroundTruth) -> None:
        self._motions = MotionObserver(cast("list[Autopilot]", list(vehicles)))
        self._truth = TruthObserver(target, truth)

    def see(self, now: int) -> bool:
        motions = self._motions.see(now)
        if motions is not None:
            self._truth.take(now, [motions])
        return motions is not None


def watch(
    vehicles: Sequence[OnRails],
    truth: GroundTruth,
    seconds: float,
    tick: int = 5_000,
    at: Any = (0.0, 0.0, 0.0),
) -> list[int]:
    """Times at which a sample was taken, the target being ``at`` (m)."""
    target = StandingTarget(FixedTarget(kind="fixed", at=at), FLEET)
    seen = Observer(vehicles, target, truth)
    taken = []
    for now in range(tick, round(seconds * 1e6) + 1, tick):
        for vehicle in vehicles:
            vehicle.move(now - tick, now)
        if seen.see(now):
            taken.append(now)
    return taken


def passing(offset: float, speed: float) -> Any:
    """Along x through the middle, ``offset`` aside, between two looks at it."""
    return lambda time: (speed * (time - MIDDLE), offset, 5.0)


def test_a_fast_pass_between_two_samples_is_seen() -> None:
    vehicles = [OnRails(lambda _: (0.0, 0.0, 5.0)), OnRails(passing(0.1, 100.0))]
    seen = truth(vehicles)
    taken = watch(vehicles, seen, 1.0)
    # Below 0.5 m for 10 ms: shorter than the pause between samples.
    assert (np.diff(taken) == SAMPLE).all()
    assert (seen.vehicles.count, seen.vehicles.minimum) == (1, pytest.approx(0.1, abs=1e-9))
    assert seen.samples().separation.min() == pytest.approx(0.1, abs=1e-9)


def test_vehicles_on_the_ground_do_not_count() -> None:
    vehicles = [OnRails(lambda _: (0.0, 0.0, 0.0), airborne=False), OnRails(passing(0.1, 4.0))]
    seen = truth(vehicles, d_min_target=1.0)
    watch(vehicles, seen, 1.0)
    assert (seen.vehicles.count, seen.vehicles.minimum) == (0, float("inf"))
    assert np.isinf(seen.samples().separation).all()


@pytest.mark.parametrize(("d_min", "count"), [(None, 0), (1.0, 1), (0.05, 0)])
def test_the_target_counts_where_it_is_an_obstacle(d_min: float | None, count: int) -> None:
    vehicles = [OnRails(passing(0.1, 4.0))]
    seen = truth(vehicles, d_min)
    watch(vehicles, seen, 1.0, at=(0.0, 0.0, 5.0))
    assert seen.target.count == count
    assert seen.vehicles.count == 0
    if d_min is not None:
        assert seen.target.minimum == pytest.approx(0.1, abs=1e-9)


def test_samples_are_in_fleet_enu_and_nan_where_there_is_nothing() -> None:
    vehicles = [OnRails(passing(0.3, 2.0)), OnRails(lambda _: (1.0, 2.0, 3.0), reference=False)]
    seen = truth(vehicles)
    taken = watch(vehicles, seen, 1.0, at=(7.0, 8.0, 9.0))
    samples = seen.samples()
    assert samples.time.tolist() == taken
    count = len(taken)
    for part in (samples.position, samples.velocity, samples.acceleration, samples.reference):
        assert part.shape == (count, 2, 3)
    assert samples.yaw.shape == samples.tilt.shape == (count, 2)
    assert np.allclose(samples.position[:, 0, 0], 2.0 * (samples.time * 1e-6 - MIDDLE))
    assert np.allclose(samples.position[:, 1], (1.0, 2.0, 3.0))
    assert np.allclose(samples.velocity, (1.0, 0.0, 0.0))
    # Nose to the north.
    assert np.allclose(samples.yaw, np.pi / 2)
    assert not samples.tilt.any()
    assert np.allclose(samples.reference[:, 0], samples.position[:, 0])
    assert np.isnan(samples.reference[:, 1]).all()
    assert np.allclose(samples.target, (7.0, 8.0, 9.0))
    position, velocity, target = seen.latest()
    assert np.array_equal(position, samples.position[-1])
    assert np.array_equal(velocity, samples.velocity[-1])
    assert target is not None
    assert np.array_equal(target, (7.0, 8.0, 9.0))


def test_samples_can_be_had_for_a_time() -> None:
    vehicles = [OnRails(passing(0.3, 2.0))]
    seen = truth(vehicles)
    taken = watch(vehicles, seen, 1.0)
    since, until = taken[7], taken[19]
    assert seen.samples(since, until).time.tolist() == taken[7:19]
    assert seen.samples(until=since).time.tolist() == taken[:7]
    none = seen.samples(10_000_000)
    assert (len(none.time), none.target.shape) == (0, (0, 3))


def test_nothing_is_seen_twice() -> None:
    vehicles = [OnRails(lambda _: (0.0, 0.0, 5.0)), OnRails(lambda _: (0.1, 0.0, 5.0))]
    seen = truth(vehicles)
    target = StandingTarget(FixedTarget(kind="fixed", at=(0.0, 0.0, 0.0)), FLEET)
    observer = Observer(vehicles, target, seen)
    for vehicle in vehicles:
        vehicle.move(0, 5_000)
    assert observer.see(5_000)
    assert not observer.see(10_000_000)
    assert len(seen.samples().time) == 1
    assert seen.vehicles.count == 1


@settings(deadline=None, max_examples=20)
@given(st.floats(0.01, 3.0), st.floats(0.5, 20.0))
def test_separation_is_the_least_of_every_step(offset: float, speed: float) -> None:
    vehicles = [OnRails(lambda _: (0.0, 0.0, 5.0)), OnRails(passing(offset, speed))]
    seen = truth(vehicles)
    watch(vehicles, seen, 1.0)
    steps = np.arange(1, 401) * 2_500e-6
    exact = np.hypot(speed * (steps - MIDDLE), offset)
    assert seen.vehicles.minimum == pytest.approx(exact.min())
    assert seen.samples().separation.min() == pytest.approx(exact.min())
    assert seen.vehicles.count == bool(exact.min() < LEAST)


def test_the_emulated_autopilot_is_watched_at_every_physics_step() -> None:
    config = AutopilotConfig(system_id=11, latitude=47.397742, longitude=8.545594, altitude=488.0)
    autopilot = Autopilot(config, FIREFLY, FLEET, 1)
    seen = GroundTruth(1, Limits(LEAST, 1.0))
    observer = Observer(
        [autopilot], StandingTarget(FixedTarget(kind="fixed", at=(0.0, 0.0, 0.0)), FLEET), seen
    )
    inbox: list[Datagram] = []
    taken = []
    for now in range(0, 200_001, 5_000):
        autopilot.step(now, inbox)
        if observer.see(now):
            taken.append(now)
    assert taken == list(range(5_000, 200_001, SAMPLE))
    samples = seen.samples()
    assert np.allclose(samples.position[:, 0], 0.0, atol=1e-6)
    assert np.isnan(samples.reference).all()
    # On the ground nobody is near anybody.
    assert seen.target.count == 0


def test_with_downwash_heights_count_for_less() -> None:
    vehicles = [OnRails(lambda _: (0.0, 0.0, 5.0)), OnRails(lambda _: (0.0, 0.3, 5.8))]
    seen = GroundTruth(2, Limits(LEAST, downwash=2.0))
    watch(vehicles, seen, 0.2)
    assert seen.vehicles.minimum == pytest.approx(0.5, abs=1e-9)
    assert truth(vehicles).vehicles.minimum > 0.8
