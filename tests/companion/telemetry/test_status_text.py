"""What the ground hears: events once and never many at a time, figures once a second; all only if asked."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.config import CompanionConfig
from companion.config.flight import GroundMessagesConfig
from companion.telemetry.metrics import Metrics
from companion.telemetry.status_text import Severity, StatusReporter
from companion.values.components import COMPONENT
from mavlink_bridge.messages import NamedValue, Source, StatusText
from tests.companion.bench import AUTOPILOT, START, SYSTEM, TICK, Bench, only, seen_at
from tests.companion.obstacles.test_proximity import scan

OWN = Source(SYSTEM, COMPONENT)
ON = GroundMessagesConfig(texts=True)
severities = st.sampled_from(list(Severity))
EVENTS = st.lists(st.tuples(st.integers(0, 3_000_000), severities, st.integers(0, 30).map(str)), max_size=60)


@given(EVENTS)
def test_never_more_than_five_at_once_and_one_a_second(events):
    reporter, now, said = StatusReporter(ON, OWN), START, []
    for later, severity, text in events:
        now += later
        reporter.say(severity, text)
        said += [now] * len(reporter.due(now))
    for k, first in enumerate(said):
        for j in range(k, len(said)):
            assert j - k + 1 <= 5 + (said[j] - first) // 1_000_000


@given(EVENTS)
def test_the_most_severe_is_said_first_and_lost_last(events):
    reporter = StatusReporter(ON, OWN)
    for _, severity, text in events:
        reporter.say(severity, text)
    said = [text for k in range(30) for text in reporter.due(START + k * 10_000_000)]
    assert [text.severity for text in said] == sorted(text.severity for text in said)
    assert len(said) <= 16
    assert len({text.text for text in said}) == len(said)
    if events:
        assert said[0].severity == min(severity for _, severity, _ in _first_of_each(events))


def _first_of_each(events):
    return {text: (later, severity, text) for later, severity, text in reversed(events)}.values()


@given(st.lists(st.booleans(), max_size=40))
def test_what_goes_wrong_is_said_when_it_begins_and_when_it_ends(states):
    reporter, said = StatusReporter(ON, OWN), []
    for k, wrong in enumerate(states):
        reporter.watch(wrong, "gone", "back")
        said += [text.text for text in reporter.due(START + k * 1_000_000)]
    begun = [b for a, b in zip([False, *states], states, strict=False) if a != b]
    assert said == ["gone" if wrong else "back" for wrong in begun]


def test_unless_asked_nothing_is_said():
    reporter = StatusReporter(GroundMessagesConfig(), OWN)
    reporter.say(Severity.CRITICAL, "on fire")
    reporter.watch(True, "gone", "back")
    assert reporter.due(START) == []
    bench = Bench(task="escort", proximity={})
    bench.target = seen_at(1, np.array([8.0, 0.0, 0.0]))
    bench.take_off(5.0)
    bench.target = None
    bench.fly(5.0)
    assert not [m for _, _, m in bench.sent if isinstance(m, StatusText | NamedValue)]


def texts(bench, link="ground"):
    return [(time, m.text) for time, name, m in bench.sent if name == link and isinstance(m, StatusText)]


def test_a_target_that_falls_silent_and_comes_back_is_told_of_once_each():
    bench = Bench(task="escort", ground_messages={"texts": True})
    bench.target = target = seen_at(1, np.array([8.0, 0.0, 0.0]))
    bench.take_off(5.0).fly(1.0)
    assert texts(bench) == []
    silent, bench.target = bench.now, None
    bench.fly(6.0)
    bench.target = target
    bench.fly(2.0)
    (lost, first), (back, second) = texts(bench)
    assert (first, second) == ("Target lost", "Target is back")
    stale = bench.config.guard.target_stale_us
    assert stale - 100_000 <= lost - silent <= stale + 200_000
    assert 6_000_000 <= back - silent <= 6_300_000
    source = [m.source for _, _, m in bench.sent if isinstance(m, StatusText)]
    assert set(source) == {OWN}


def test_a_sensor_that_falls_silent_is_told_of():
    bench = Bench(proximity={}, ground_messages={"texts": True}).take_off(5.0)
    for _ in range(10):
        bench.step(bench.datagram("autopilot", scan({0: 9.0}, 0, source=AUTOPILOT)))
        bench.fly(0.1)
    assert texts(bench) == []
    bench.fly(2.0)
    assert [text for _, text in texts(bench)] == ["Obstacle sensor silent"]
    bench.step(bench.datagram("autopilot", scan({0: 9.0}, 0, source=AUTOPILOT)))
    bench.fly(0.5)
    assert [text for _, text in texts(bench)][1:] == ["Obstacle sensor is back"]


@pytest.mark.parametrize("links", [("ground",), ("autopilot",), ("ground", "autopilot")])
def test_figures_come_once_a_second_by_the_links_that_are_named(links):
    bench = Bench(task="escort", ground_messages={"values": True, "links": links})
    bench.target = seen_at(1, np.array([8.0, 0.0, 0.0]))
    bench.take_off(5.0)
    sent = bench.fly(10.0)
    for link in ("ground", "autopilot"):
        found = only(NamedValue, sent, link)
        named = {name: [m for m in found if m.name == name] for name in {m.name for m in found}}
        assert set(named) == ({"plan_ms", "misses", "held", "target_s"} if link in links else set())
        assert all(len(told) in (9, 10, 11) for told in named.values())
        assert all(m.source == OWN for m in found)
        assert all(0.0 <= m.value <= 0.2 for m in named.get("target_s", []))


def test_figures_are_the_same_whoever_takes_the_readings_away():
    def told(shedding):
        bench = Bench(task="escort", ground_messages={"values": True}, rates={"replan_us": 20_000})
        bench.target = seen_at(1, np.array([8.0, 0.0, 0.0]))
        bench.take_off(5.0)
        sent = []
        for _ in range(10):
            sent += bench.fly(0.7)
            if shedding:
                assert len(bench.companion.shed()) > 0
        return [(m.name, m.value) for m in only(NamedValue, sent, "ground")]

    assert told(shedding=True) == told(shedding=False)


def test_figures_are_those_of_the_plans():
    metrics = Metrics(CompanionConfig(ground_messages=GroundMessagesConfig(values=True)), OWN)
    period = CompanionConfig().rates.replan_us * 1000
    for reading in (2_000_000, period, 3_000_000):
        metrics.note(reading)

    def told(now, held):
        return {m.name: m.value for m in metrics.due(now, held, None)}

    assert told(START, 0) == {"plan_ms": period * 1e-6, "misses": 0.0, "held": 0.0}
    assert told(START + TICK, 0) == {}
    for reading in (period + 1, 5):
        metrics.note(reading)
    assert told(START + 1_000_000, 2) == {"plan_ms": (period + 1) * 1e-6, "misses": 1.0, "held": 2.0}
    assert told(START + 5_500_000, 2) == {"misses": 1.0, "held": 2.0}
    assert told(START + 6_000_000, 2) == {"misses": 1.0, "held": 2.0}
