"""What counts as a detection, when its image was taken, and what is said of it to the others."""

from __future__ import annotations

import numpy as np
import pytest

from mavlink_bridge.wire.codec import Codec
from tests.companion.estimation.cameras import START
from tests.companion.estimation.sightings import (
    CAMERA,
    OWN,
    PLACE,
    forwarded,
    give,
    heard,
    own_detection,
    started,
    view,
    world,
)


def test_own_detections_and_forwarded_ones_are_dated_by_the_image():
    of, now = started()
    give(of, now, "autopilot", own_detection(now - START - 150_000))
    assert of.target.age(now) == pytest.approx(150_000, abs=10_000)
    give(of, now + 10_000, "swarm", forwarded(now - START - 60_000))
    assert of.target.age(now) == pytest.approx(60_000, abs=25_000)
    counts = of.target.counts
    assert (counts.own, counts.others, counts.used, counts.invalid, counts.late) == (1, 1, 2, 0, 0)
    assert of.target.last(now).position == pytest.approx(PLACE, abs=0.1)


@pytest.mark.parametrize("rate", [0.6, -0.6])
def test_the_state_turns_as_the_target_does(rate):
    """It walks round a circle at 1.5 m/s; two cameras know about half of its acceleration."""
    exact = {"sigma_horizontal": 0.02, "sigma_vertical": 0.02, "sigma_yaw_deg": 0.1, "sigma_tilt_deg": 0.1}
    of = world(own_errors=exact)
    for tick in range(50):
        now = START + 1_000_000 + 100_000 * tick
        heard(of, now)
        angle = rate * 0.1 * tick
        place = 2.5 * np.array([np.cos(angle), np.sin(angle), 0.0])
        give(of, now + 1_000, "autopilot", own_detection(now - START, place))
        give(of, now + 2_000, "swarm", forwarded(now - START, place))
    assert 0.3 < of.target.last(now + 2_000).turn_rate / rate < 1.2
    assert of.at(now + 2_000).target.turn_rate == of.target.last(now + 2_000).turn_rate


def test_without_the_time_of_the_image_it_is_as_old_as_configured():
    of, now = started(latency_us=300_000)
    give(of, now, "autopilot", own_detection(0)[1:])
    assert of.target.age(now) == 300_000


SEEN, SAID = own_detection(1_800_000)
UNUSABLE = {
    "no vehicle of the fleet": ("swarm", forwarded(1_900_000, system=77)),
    "no time": ("swarm", forwarded(1_900_000)[1:]),
    "a neighbour's future": ("swarm", forwarded(20_000_000)),
    "the future": ("autopilot", own_detection(20_000_000)),
    "accuracy": ("autopilot", (SEEN, SAID._replace(horizontal_accuracy=1e9))),
    "another target": ("autopilot", (SEEN, SAID._replace(device=3))),
    "not tracking": ("autopilot", (SEEN, SAID._replace(status=0))),
    "far away": ("autopilot", (SEEN, SAID._replace(altitude=1e30))),
}


@pytest.mark.parametrize(("link", "messages"), UNUSABLE.values(), ids=UNUSABLE.keys())
def test_what_cannot_be_used_is_counted_and_dropped(link, messages):
    of, now = started(device=0)
    give(of, now, link, messages)
    assert of.target.counts.invalid == 1
    assert of.target.counts.used == 0
    assert of.target.last(now) is None


def test_a_listed_fleet_excludes_others():
    of, now = started(vehicles=[13])
    give(of, now, "swarm", forwarded(now - START - 60_000))
    assert of.target.counts.invalid == 1
    give(of, now, "autopilot", own_detection(now - START - 150_000))
    assert of.target.counts.own == 1


def test_a_detection_that_arrives_twice_counts_once():
    of, now = started()
    for later in (0, 20_000):
        give(of, now + later, "swarm", forwarded(now - START - 60_000))
    assert (of.target.counts.used, of.target.counts.invalid) == (1, 1)


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_a_place_that_is_no_number_is_counted_as_bad_and_dropped(value):
    codec = Codec()
    assert codec.feed(codec.encode(SAID._replace(altitude=value))) == []
    assert (codec.counters.good, codec.counters.bad) == (0, 1)


def test_an_accuracy_that_is_no_number_is_unknown_and_the_configured_one_counts():
    """NaN is what cameras fill in for what they do not know."""
    nan, codec = float("nan"), Codec()
    bare = SAID._replace(horizontal_accuracy=nan, vertical_accuracy=nan, heading_accuracy=nan)
    (said,) = codec.feed(codec.encode(bare))
    sigmas = []
    for share in (0.05, 0.2):
        of, now = started(sigma_range_share=share)
        give(of, now, "autopilot", (view(OWN, 100, now - START - 150_000, CAMERA), said))
        assert (of.target.counts.used, of.target.counts.invalid) == (1, 0)
        sigmas.append(of.target.last(now).sigma)
    assert sigmas[1] > 1.5 * sigmas[0]


def test_own_detections_are_forwarded_once_with_the_time_of_their_image():
    of, now = started()
    assert of.forwards(now) == []
    give(of, now, "autopilot", own_detection(now - START - 150_000))
    (out,) = of.forwards(now)
    assert out.time == pytest.approx(now - 150_000, abs=10_000)
    assert of.forwards(now + 10_000) == []
    give(of, now + 20_000, "autopilot", own_detection(now - START - 130_000))
    assert of.forwards(now + 20_000) == []
    assert len(of.forwards(now + 100_000)) == 1


def test_a_step_asks_the_filter_once_and_again_after_a_detection(monkeypatch):
    """A plan, the log, the status and the metrics ask for the same time."""
    of, now = started()
    give(of, now, "autopilot", own_detection(now - START - 150_000))
    asked, fusion = [], of.target._fusion
    answer = fusion.at
    monkeypatch.setattr(fusion, "at", lambda time, longest: asked.append(time) or answer(time, longest))
    before = of.at(now).target
    of.target.record(now)
    of.target.at(now), of.target.covariance(now), of.target.age(now)
    assert asked == [now]
    # Between the last two: what is known at ``now`` has changed.
    give(of, now, "swarm", forwarded(now - START - 60_000, PLACE + 0.1))
    after = of.target.last(now)
    assert asked == [now, now]
    assert np.linalg.norm(after.position - before.position) > 0.01
    of.target.last(now + 1)
    assert asked == [now, now, now + 1]
