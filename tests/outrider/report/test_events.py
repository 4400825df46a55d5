"""What happened, out of the configuration, the motions and the logs, in the order of time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mavlink_bridge.messages import CommandAck, Heartbeat, Source, StatusText
from mavlink_bridge.tlog.log import TlogReport
from outrider.report.command import make
from outrider.report.distances import encounters
from outrider.report.events import Event, together
from outrider.report.log_events import LogEvent, command, sayings
from outrider.report.run import EventMessage, Log, Motions, Said, Stream
from tests.outrider.report.runs import BEFORE, leave
from tests.outrider.shipped import scenario

AUTOPILOT = Source(11, 1)
NONE = np.empty(0, dtype=np.int64)


def log_of(*said: Said) -> Log:
    sent = Stream(NONE, NONE, NONE)
    uttered = tuple(EventMessage(1000 * n, one) for n, one in enumerate(said))
    report = TlogReport(len(said), 0, 0, 0, 0, False)
    return Log(11, 0, 1000, sent, {}, NONE, np.empty((0, 3)), uttered, report)


def beat(custom: int, base: int = 0) -> Heartbeat:
    return Heartbeat(AUTOPILOT, 13, 3, base, custom, 4)


def test_all_kinds_in_the_order_of_time(tmp_path: Path) -> None:
    trouble = scenario(
        "antipodal-8",
        vehicles=3,
        faults=[{"kind": "freeze", "vehicle": 12, "at_s": 2.0, "for_s": 1.5}],
        partitions=[{"at_s": 4.0, "for_s": 1.0, "members": [11, 12]}],
    )
    events = make(leave(tmp_path, scenario=trouble).directory).events
    assert [event.time for event in events] == sorted(event.time for event in events)
    kinds = [event.kind for event in events]
    assert [kind for kind in kinds if kind not in ("mode", "armed")] == [
        "refused",
        "text",
        "goal",
        "fault",
        "partition",
        "converged",
    ]
    by_kind = {event.kind: event for event in events}
    assert (by_kind["fault"].time, by_kind["fault"].until, by_kind["fault"].who) == (2.0, 3.5, (12,))
    assert (by_kind["partition"].time, by_kind["partition"].until) == (4.0, 5.0)
    assert by_kind["converged"].time == 7.5
    assert by_kind["refused"].text == "NAV_TAKEOFF: denied"
    assert by_kind["text"].text == "info: Armed"
    assert by_kind["text"].time == pytest.approx(2.0 - BEFORE, abs=0.03)
    assert by_kind["text"].who == (11, 12, 13)


def test_clocks_that_differ_move_no_event(tmp_path: Path) -> None:
    late = {11: 4_000_000, 12: 0, 13: -3_000_000}
    events = make(leave(tmp_path, late=late).directory).events
    (text,) = (event for event in events if event.kind == "text")
    assert text.who == (11, 12, 13)


def test_what_several_say_alike_is_said_once() -> None:
    said = [Event(0.0, "mode", (11,), "a"), Event(0.1, "mode", (12,), "a"), Event(0.2, "mode", (12,), "b")]
    later = Event(9.0, "mode", (13,), "a")
    again = Event(0.3, "mode", (11,), "a")
    assert together([*said, again, later]) == [
        Event(0.0, "mode", (11, 12), "a"),
        Event(0.2, "mode", (12,), "b"),
        again,
        later,
    ]


def test_changes_of_a_heartbeat() -> None:
    log = log_of(beat(0), beat(4), beat(4, 0x80), beat(4, 0x80), beat(9, 0))
    assert [(one.time, one.kind, one.text) for one in sayings(log)] == [
        (0, "mode", "STABILIZE, disarmed"),
        (1000, "mode", "STABILIZE → GUIDED"),
        (2000, "armed", "armed"),
        (4000, "armed", "disarmed"),
        (4000, "mode", "GUIDED → LAND"),
    ]


def test_commands_by_their_names() -> None:
    assert command(22) == "NAV_TAKEOFF"
    assert command(64_999) == "command 64999"
    acknowledged = [CommandAck(AUTOPILOT, 22, result, 0, 0, 1, 1) for result in (0, 5, 3, 200)]
    assert [one.text for one in sayings(log_of(*acknowledged))] == [
        "NAV_TAKEOFF: unsupported",
        "NAV_TAKEOFF: result 200",
    ]


def test_a_long_text_is_put_together() -> None:
    pieces = [StatusText(AUTOPILOT, 2, "x" * 50), StatusText(AUTOPILOT, 2, "end")]
    uttered = tuple(EventMessage(0, piece) for piece in pieces)
    log = log_of()._replace(utterances=uttered)
    assert list(sayings(log)) == [LogEvent(0, "text", f"critical: {'x' * 50}end", bad=True)]


def motions_of(apart: np.ndarray) -> Motions:
    """Two vehicles, 5 m up, so far from each other."""
    count = len(apart)
    position = np.zeros((count, 2, 3))
    position[..., 2] = 5.0
    position[:, 1, 0] = apart
    flat = np.zeros((count, 2))
    target = np.full((count, 3), 50.0)
    time = 0.02 * np.arange(count)
    moving = np.empty((count, 0, 3))
    return Motions((11, 12), time, position, position, position, flat, flat, target, apart, moving)


def test_every_encounter_below_the_limit() -> None:
    apart = np.array([2.0, 0.4, 0.3, 0.4, 2.0, 2.0, 0.45, 2.0])
    first, second = encounters(motions_of(apart), 0.5, None)
    assert (first.begin, first.end, first.least, first.who) == (0.02, 0.06, pytest.approx(0.3), (11, 12))
    assert (second.begin, second.end) == (pytest.approx(0.12), pytest.approx(0.12))


def test_an_encounter_between_two_samples_is_seen() -> None:
    """Separation is measured at every physics step, places are kept at every eighth."""
    motions = motions_of(np.full(50, 2.0))
    separation = np.full(50, 2.0)
    separation[30] = 0.45
    (found,) = encounters(motions._replace(separation=separation), 0.5, None)
    assert (found.time, found.least, found.who) == (pytest.approx(0.6), 0.45, (11, 12))


def test_obstacles_and_the_target_count_where_the_scenario_says_so() -> None:
    motions = motions_of(np.linspace(9.0, 3.0, 60))
    target = np.zeros((60, 3))
    target[:, 2] = 5.0
    post = {"kind": "post", "at": [6.0, 0.0], "radius": 0.2, "height": 9.0}
    of = scenario("antipodal-8", vehicles=2, d_min_target=1.0, d_min_obstacle=0.5, obstacles=[post])
    found = encounters(motions._replace(target=target), 0.5, of)
    assert {one.who for one in found} == {(11, "the target"), (12, "an obstacle")}
