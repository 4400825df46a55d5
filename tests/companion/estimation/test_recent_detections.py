"""Laws of what was seen recently: who saw the target how often, and with which weight."""

from __future__ import annotations

import numpy as np
import pytest

from companion.estimation.detections import detection
from companion.estimation.fusion import Fusion
from tests.companion.estimation.cameras import START, message, source_of
from tests.companion.estimation.flights import STEP, WINDOW, flight, fused


def test_what_was_seen_recently_is_counted_by_vehicle_with_its_median_weight():
    source, found, _ = flight("rtk", 6, 1.9)
    found[25] = found[25]._replace(fields=np.concatenate([[40.0, 0.0, 0.0], found[25].fields[3:]]))
    fusion, since = fused(source, found[::-1]), found[0].time + 500_000
    used = [one for one in found if one is not found[25] and one.time >= since]
    seen = fusion.recent(since)
    assert set(seen) == {11, 12, 13}
    assert fusion.refused == 1
    for vehicle, (number, weight) in seen.items():
        weights = [one.weight for one in used if one.vehicle == vehicle]
        assert number == len(weights)
        assert weight == pytest.approx(np.median(weights), rel=1e-12)
    assert fusion.recent(found[-1].time + 1) == {}


def test_one_detection_that_weighs_a_hundred_times_as_much_hardly_changes_the_weight():
    """A false detection nearby that passes: w_k is computed with the measured distance."""
    source, found, _ = flight("rtk", 6, 1.9)
    since = found[0].time + 500_000
    clean = fused(source, found).recent(since)
    row = max(k for k, one in enumerate(found) if one.vehicle == 12)
    found[row] = found[row]._replace(weight=100.0 * found[row].weight)
    seen = fused(source, found).recent(since)
    assert seen[12].weight == pytest.approx(clean[12].weight, rel=0.1)
    assert (seen[11], seen[13]) == (clean[11], clean[13])


def test_detections_beyond_the_window_are_remembered():
    """Up to 16 of each vehicle, however long ago: of rare ones all count."""
    source = source_of("truth")
    camera, place, period = np.array([6.0, 0.0, 5.0]), np.zeros(3), 1_100_000
    found = [
        detection(source, 11, START + k * period, place, tuple(camera), message(11, place, camera))
        for k in range(15)
    ]
    fusion = fused(source, [one for one in found if one is not None])
    for count in (1, 3, 9, 15):
        seen = fusion.recent(START + (15 - count) * period)
        assert seen[11].number == count
        assert seen[11].weight == pytest.approx(found[0].weight, rel=1e-6)


def test_a_new_beginning_forgets_who_saw_the_wrong_place():
    """Vehicle 12 sees a wrong place for six seconds, alone; then 11 sees the true one."""
    source, camera = source_of("truth"), np.array([6.0, 0.0, 5.0])
    fusion = Fusion(source, WINDOW)
    for tick in range(120):
        vehicle, place = (12, np.array([20.0, 0.0, 0.0])) if tick < 60 else (11, np.zeros(3))
        if not 60 <= tick < 75:
            time = START + tick * STEP
            one = detection(source, vehicle, time, place, tuple(camera), message(vehicle, place, camera))
            assert one is not None
            fusion.put(one)
            fusion.at(time, WINDOW)
    assert fusion.restarts == 1
    assert set(fusion.recent(START)) == {11}
