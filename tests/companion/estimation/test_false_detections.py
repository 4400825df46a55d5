"""Laws of false detections and of a compromised sender: what each can do is bounded."""

from __future__ import annotations

from math import sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.estimation.detections import Detection
from companion.estimation.fusion import Fusion
from tests.companion.estimation.cameras import START, Vehicle, source_of
from tests.companion.estimation.flights import STEP, WINDOW, at, flight, fused


@given(st.integers(0, 500), st.tuples(*[st.floats(-30.0, 30.0)] * 3))
@settings(max_examples=40)
def test_one_detection_moves_the_estimate_by_no_more_than_its_gate_allows(seed, by):
    """‖Δp‖² ≤ γ·λ_max(P): Δp = K y, K S Kᵀ = P − P⁺ ≤ P, and yᵀS⁻¹y ≤ γ."""
    source, found, _ = flight("gnss", seed, 1.0)
    end = found[-1].time
    before, wrong = at(fused(source, found), end), found[-1]
    fields = wrong.fields.copy()
    fields[:3] += by
    after = at(fused(source, [*found, replace_fields(wrong, end, fields)]), end)
    most = sqrt(source.gate * float(np.linalg.eigvalsh(before.covariance)[-1]))
    assert float(np.linalg.norm(after.position - before.position)) <= most


def replace_fields(one: Detection, time: int, fields) -> Detection:
    return one._replace(time=time, fields=fields, vehicle=one.vehicle)


@pytest.mark.parametrize("strategy", ["edge", "patient"])
@pytest.mark.parametrize("profile", ["truth", "rtk", "gnss"])
def test_one_compromised_neighbour_of_five_moves_it_by_a_few_sigmas_at_most(profile, strategy):
    """It knows the filter, and always pushes east: to the edge of the gate, or just below suspicion."""
    worst = []
    for seed in range(4):
        source, found, _ = flight(profile, seed, 6.0, vehicles=5)
        honest, attacked = Fusion(source, WINDOW), Fusion(source, WINDOW)
        share = 0.999 if strategy == "edge" else sqrt(5.5 / source.gate)
        for one in found:
            if one.vehicle != 15:
                honest.put(one)
                attacked.put(one)
            elif one.time > START + 1_000_000:
                attacked.put(one._replace(fields=pushed(attacked, one, share)))
        a, b = at(honest, found[-1].time), at(attacked, found[-1].time)
        sigma = sqrt(float(np.linalg.eigvalsh(a.covariance)[-1]))
        worst.append(float(np.linalg.norm(a.position - b.position)) / sigma)
    assert max(worst) < sqrt(source_of(profile).gate)


def pushed(fusion: Fusion, one: Detection, share: float):
    """The detection, moved east as far as a share of the gate allows."""
    known = at(fusion, one.time)
    fields = one.fields.copy()
    R = fields[3:12].reshape(3, 3)
    reach = sqrt(16.27) * share * sqrt(float((known.covariance + R)[0, 0]))
    fields[:3] = known.position + np.array([reach, 0.0, 0.0])
    return fields


def test_false_detections_make_no_jump():
    random = np.random.default_rng(5)
    for seed in range(5):
        source, found, _ = flight("rtk", seed, 6.0)
        wrong = [
            one._replace(fields=np.concatenate([random.uniform(-15, 15, 3), one.fields[3:]]))
            if random.uniform() < 0.05 and one.time > START
            else one
            for one in found
        ]
        clean, fusion = Fusion(source, WINDOW), Fusion(source, WINDOW)
        for one, other in zip(found, wrong, strict=True):
            clean.put(one)
            fusion.put(other)
            if one.time > START + 1_000_000:
                a, b = at(clean, one.time), at(fusion, one.time)
                assert np.linalg.norm(a.position - b.position) < 1.0


def adapted(fusion: Fusion) -> float:
    """θ of the horizontal acceleration after the last detection."""
    assert at(fusion, START).time
    return float(fusion._memories[len(fusion._detections) - 1, 0])


def test_false_detections_say_nothing_of_the_targets_acceleration():
    """One in ten is false, whoever detects: the acceleration's σ grows by less than a third in 8 s.

    Counted with d² = ``gate``, as those of a target that turned, they make it eight times as large.
    """
    random = np.random.default_rng(7)
    for seed in range(2):
        source, found, _ = flight("rtk", seed, 8.0)
        wrong = [
            one._replace(fields=np.concatenate([random.uniform(-15, 15, 3), one.fields[3:]]))
            if random.uniform() < 0.1
            else one
            for one in found
        ]
        grown = adapted(fused(source, wrong)) - adapted(fused(source, found))
        assert np.exp(0.5 * grown) < 1.33


def test_refused_detections_that_agree_say_that_the_target_accelerates():
    """It rests for 3 s, then runs at 6 m/s at once: all are refused, and θ grows at once."""
    source, random = source_of("truth", 0.1), np.random.default_rng(3)
    cameras = [Vehicle(11 + k, 1.3 * k, source, random) for k in range(4)]
    fusion = Fusion(source, WINDOW)
    for tick in range(34):
        time = START + tick * STEP
        place = np.array([6.0 * max(0.1 * (tick - 30), 0.0), 0.0, 0.0])
        for camera in cameras:
            fusion.put(camera.sees(time, place))
        if tick == 30:
            before = adapted(fusion)
    assert adapted(fusion) > before + 1.0


def test_after_a_false_beginning_it_begins_anew():
    source, found, walker = flight("rtk", 2, 4.0)
    fields = found[0].fields.copy()
    fields[:3] += 30.0
    fusion = Fusion(source, WINDOW)
    for one in (found[0]._replace(fields=fields), *found[1:]):
        fusion.put(one)
        fusion.at(one.time, WINDOW)
    known = at(fusion, found[-1].time)
    assert np.linalg.norm(known.position - walker.place) < 0.5
    # After a second without anything that passes, or at once if the first was not trusted.
    assert known.time == found[-1].time
