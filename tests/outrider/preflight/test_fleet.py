"""The check of a fleet beside our own autopilots, in lock-step: what is measured is true, what is amiss is
found, and all come to the same fleet file."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.avoidance.certified.margins import between
from companion.flight.autopilots.ardupilot import ARDUPILOT
from mavlink_bridge.messages import Source, Tunnel
from mavlink_bridge.network.channel import Faults
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.preflight import MOST, LinkReport, Report, pack
from outrider.preflight.autopilot import AutopilotFigures
from outrider.preflight.findings import Result
from outrider.preflight.judgement import judge
from outrider.preflight.node import Preflight
from outrider.preflight.own_checks import own_checks
from outrider.preflight.terms import Terms
from outrider.preflight.tube import TrackingError
from outrider.scenarios.fleet_file import FleetFile, text_of
from outrider.yaml_files.yaml_file import read
from tests.outrider.preflight.bench import BEGIN, ORIGIN, Fleet, companion, failed, found


def fleet_file(fleet: Fleet) -> FleetFile:
    """The file of all, which is the same."""
    verdicts = fleet.run()
    for verdict in verdicts.values():
        assert failed(verdict) == set()
    (text,) = {text_of(verdict.fleet) for verdict in verdicts.values() if verdict.fleet is not None}
    assert all(verdict.passed for verdict in verdicts.values())
    return read(text.encode(), "fleet.yaml", FleetFile)


def test_all_write_the_same_file_with_what_was_measured() -> None:
    delay, step = 4_000, 10_000
    fleet = fleet_file(Fleet(Faults(delay=delay)))
    assert fleet.roster == (1, 2, 3)
    assert [one.firmware for one in fleet.measured.vehicles] == ["ArduPilot", "PX4", "ArduPilot"]
    assert {(one.sender, one.receiver) for one in fleet.measured.links} == {
        (a, b) for a in (1, 2, 3) for b in (1, 2, 3) if a != b
    }
    for link in fleet.measured.links:
        assert link.loss == 0.0
        assert link.round_trip_ms is not None
        # A request is read at a step, and so is its reply.
        assert 2e-3 * delay <= link.round_trip_ms <= 1e-3 * (2 * delay + 2 * step)
        assert link.jitter_ms <= 1e-3 * step
    assert fleet.measured.configured == ("tube",)
    # The worst accuracy that was reported, rounded up to cm.
    sigma = max(one.position_sigma or 0.0 for one in fleet.measured.vehicles)
    assert sigma <= fleet.position_sigma < sigma + 0.011
    assert fleet.clock_us >= max(one.clock_us or 0 for one in fleet.measured.vehicles)
    config = companion(certified={"clock_us": fleet.clock_us}, field={"position_sigma": fleet.position_sigma})
    assert fleet.distance == pytest.approx(between(config.certified, config.field, config.limits), abs=1e-6)


def test_loss_and_jitter_of_each_direction_are_those_of_the_channel() -> None:
    lossy = {("preflight-1", "preflight-2"): Faults(delay=4_000, jitter=40_000, loss=0.4)}
    fleet = fleet_file(Fleet(overrides=lossy))
    by_pair = {(one.sender, one.receiver): one for one in fleet.measured.links}
    bad, good = by_pair[1, 2], by_pair[2, 1]
    assert 0.28 < bad.loss < 0.52
    assert 25.0 < bad.jitter_ms < 55.0
    assert (good.loss, good.jitter_ms < 11.0) == (0.0, True)


def test_a_link_that_loses_too_much_fails_in_its_direction() -> None:
    lossy = {("preflight-3", "preflight-1"): Faults(delay=4_000, loss=0.85)}
    verdicts = Fleet(overrides=lossy, seed=2).run()
    for verdict in verdicts.values():
        assert failed(verdict) == {("3 → 1", "link")}
        assert verdict.fleet is None


@pytest.mark.parametrize("ahead", [0, 40_000, -3_000_000])
def test_own_clocks_count_as_far_apart_as_they_may_be(ahead: int) -> None:
    """Two clocks that differ by D are each within D/2 of the middle; beyond 100 ms no setting allows it."""
    fleet = Fleet(ahead={2: ahead})
    verdicts = fleet.run()
    if abs(ahead) > 200_000:
        assert ("vehicle 1", "clock") in failed(verdicts["preflight-1"])
        assert ("vehicle 2", "clock") in failed(verdicts["preflight-2"])
        return
    (file,) = {text_of(one.fleet) for one in verdicts.values() if one.fleet is not None}
    clock = read(file.encode(), "fleet.yaml", FleetFile).clock_us
    assert abs(ahead) / 2 <= clock <= abs(ahead) * 0.625 + 30_000


def test_a_clock_bound_of_the_file_is_kept_or_fails() -> None:
    tight = companion(certified={"clock_us": 1_000})
    verdicts = Fleet(configs=dict.fromkeys((1, 2, 3), tight), ahead={2: 20_000}).run()
    assert ("vehicle 1", "clock") in failed(verdicts["preflight-1"])
    loose = companion(certified={"clock_us": 50_000})
    assert fleet_file(Fleet(configs=dict.fromkeys((1, 2, 3), loose), ahead={2: 20_000})).clock_us == 50_000


def test_measured_fleet_time_has_the_bound_of_its_sources() -> None:
    settings = companion(certified={"fleet_time": "measured"})
    fleet = fleet_file(Fleet(configs=dict.fromkeys((1, 2, 3), settings), system_us=2_000))
    assert fleet.fleet_time == "measured"
    for vehicle in fleet.measured.vehicles:
        assert vehicle.clock_us is not None
        assert 2_000 <= vehicle.clock_us <= 30_000


def test_without_a_source_fleet_time_fails() -> None:
    settings = companion(certified={"fleet_time": "measured"})
    verdicts = Fleet(configs=dict.fromkeys((1, 2, 3), settings), wait_s=5.0).run()
    for verdict in verdicts.values():
        assert {name for _, name in failed(verdict)} == {"clock", "report"}


def test_an_accuracy_worse_than_that_of_the_file_fails() -> None:
    exact = companion(field={"position_sigma": 0.001})
    verdict = Fleet(configs=dict.fromkeys((1, 2, 3), exact)).run()["preflight-1"]
    assert failed(verdict) == {("vehicle 1", "accuracy"), ("vehicle 2", "report"), ("vehicle 3", "report")}


def test_limits_beyond_the_autopilots_fail_and_name_the_parameter() -> None:
    fast = companion(limits={"v_max": [3.0, 3.0, 4.0]})
    verdict = Fleet(configs=dict.fromkeys((1, 2, 3), fast)).run()["preflight-2"]
    assert "MPC_Z_VEL_MAX" in found(verdict, "vehicle 2", "limits").text
    assert ("vehicle 2", "limits") in failed(verdict)


def test_a_long_time_out_is_noted_and_not_changed() -> None:
    fleet = Fleet()
    before = {system: one.saved for system, one in fleet.autopilots.items()}
    verdict = fleet.run()["preflight-1"]
    check = found(verdict, "vehicle 1", "time-out")
    assert (check.result, check.text.startswith("GUID_TIMEOUT 3 s")) == (Result.NOTE, True)
    assert {system: one.saved for system, one in fleet.autopilots.items()} == before
    assert not any(one.armed for one in fleet.autopilots.values())


OTHERS: dict[str, dict[str, Any]] = {
    "d_min": {"configs": {3: companion(field={"d_min": 0.6})}},
    "tube": {"configs": {3: companion(certified={"tube": 0.5})}},
    "origin": {"origins": {3: ORIGIN.model_copy(update={"altitude": ORIGIN.altitude + 1.0})}},
    "roster": {"configs": {3: companion(certified={"fleet": [1, 2, 3, 4]})}},
}


@pytest.mark.parametrize("what", OTHERS)
def test_a_vehicle_of_another_fleet_is_found_by_all(what: str) -> None:
    verdicts = Fleet(**OTHERS[what], wait_s=5.0).run()
    for name in ("preflight-1", "preflight-2"):
        assert ("vehicle 3", "report") in failed(verdicts[name])
        assert "other common settings" in found(verdicts[name], "vehicle 3", "report").text
    assert {("vehicle 1", "report"), ("vehicle 2", "report")} <= failed(verdicts["preflight-3"])


def test_two_companions_with_one_id_are_found_by_both_and_by_the_others() -> None:
    verdicts = Fleet(twins=(2,)).run()
    assert ("vehicle 2", "id") in failed(verdicts["preflight-2"])
    assert ("vehicle 2", "id") in failed(verdicts["preflight-2'"])
    for name in ("preflight-1", "preflight-3"):
        assert found(verdicts[name], "vehicle 2", "report").text == "two companions have this id"
    assert not any(verdict.passed for verdict in verdicts.values())


def test_a_missing_vehicle_is_waited_for_and_then_named() -> None:
    fleet = Fleet(present=(1, 2), wait_s=5.0)
    fleet.loop.run(3_000_000)
    assert fleet.nodes["preflight-1"].doing == "waiting for preflight of vehicle 3"
    for own, verdict in zip((1, 2), fleet.run().values(), strict=True):
        # Its clock was not compared with that of the missing one, nor was the other's.
        clocks = {(f"vehicle {own}", "clock"), (f"vehicle {3 - own}", "report")}
        links = {("3 → 1", "link"), ("3 → 2", "link")}
        assert failed(verdict) == {("vehicle 3", "report"), *clocks, *links}
        assert found(verdict, "vehicle 3", "report").text == "not heard"


FLOWN = TrackingError(0.412, 60.0, 1.9)


def test_the_tube_is_the_worst_that_was_flown_and_the_settings_cover_who_has_not_flown() -> None:
    assert fleet_file(Fleet()).tube == 0.25
    flown = {1: FLOWN, 2: FLOWN._replace(largest=0.1), 3: FLOWN._replace(largest=0.2)}
    fleet = fleet_file(Fleet(flown=flown))
    assert (fleet.tube, fleet.measured.configured) == (0.42, ())
    assert [one.tube for one in fleet.measured.vehicles] == [0.412, 0.1, 0.2]
    partly = fleet_file(Fleet(flown={2: flown[2]}))
    assert (partly.tube, partly.measured.configured) == (0.25, ("tube",))


def test_a_tube_of_the_file_is_kept_or_fails() -> None:
    wide, narrow = (dict.fromkeys((1, 2, 3), companion(certified={"tube": tube})) for tube in (0.5, 0.4))
    assert fleet_file(Fleet(configs=wide, flown={1: FLOWN})).tube == 0.5
    verdict = Fleet(configs=narrow, flown={1: FLOWN}).run()["preflight-1"]
    assert failed(verdict) == {("vehicle 1", "tube")}


def test_a_drift_that_was_not_measured_is_noted_with_that_of_wind() -> None:
    noted = found(Fleet().run()["preflight-1"], "vehicle 1", "drift")
    assert noted.result is Result.NOTE
    for word in ("0.5 m counts", "not measured", "5 m/s of wind", "--fly"):
        assert word in noted.text


@pytest.mark.parametrize(
    ("tube", "flown", "result"),
    [
        (None, 1.0, Result.PASS),
        (None, 0.1, Result.FAIL),
        (0.3, 0.1, Result.FAIL),
        (0.9, 0.1, Result.PASS),
        (0.9, None, Result.PASS),
        (0.3, 1.0, Result.FAIL),
    ],
)
def test_a_drift_is_compared_with_the_tube_of_the_fleet_file(
    tube: float | None, flown: float | None, result: Result
) -> None:
    """0.8 m: others allow the drift of the file, or the tube if that is larger: stated, else measured."""
    stated = {} if tube is None else {"tube": tube}
    autopilot = AutopilotFigures(Source(1, 191), planar=False, utc=False)
    autopilot.profile = ARDUPILOT
    error = None if flown is None else FLOWN._replace(largest=flown)
    config = companion(certified={"drift": 0.5, **stated})
    checks = own_checks(1, config, autopilot, 1000, error, 0.8, doubled=False)
    assert [one.result for one in checks if one.name == "drift"] == [result]


def test_a_gentle_flight_says_nothing_about_the_tube() -> None:
    verdict = Fleet(flown={1: FLOWN._replace(acceleration=1.5)}).run()["preflight-1"]
    assert failed(verdict) == {("vehicle 1", "tube")}
    assert "too gentle" in found(verdict, "vehicle 1", "tube").text


def test_an_accuracy_that_no_setting_allows_fails() -> None:
    far = Report(1, 0, True, (False,) * 3, 0, 1, 3, 0, (6_000, 1_000, None), ())
    verdict = judge((), {1: far, 2: far}, {}, companion(certified={"fleet": [1, 2]}), ORIGIN, 5.0)
    assert failed(verdict) == {("fleet", "settings")}
    assert "position_sigma" in found(verdict, "fleet", "settings").text


halves, words = st.none() | st.integers(0, 65_535), st.integers(0, 2**32 - 1)
links = st.builds(
    LinkReport,
    st.integers(1, 255),
    st.integers(0, 10_000),
    st.integers(0, MOST),
    st.none() | st.integers(0, MOST),
)
reports = st.builds(
    Report,
    words,
    words,
    st.booleans(),
    st.tuples(*[st.booleans()] * 3),
    st.just(0),
    st.just(1),
    st.integers(0, 255),
    words,
    st.tuples(halves, st.none() | words, halves),
    st.lists(links, max_size=11).map(tuple),
)


@given(st.dictionaries(st.sampled_from([1, 2, 3]), reports, min_size=1))
def test_whatever_others_report_gives_a_verdict_and_a_file_only_if_all_is_good(
    heard: dict[int, Report],
) -> None:
    missing = {system: "not heard" for system in (1, 2, 3) if system not in heard}
    verdict = judge((), heard, missing, companion(), ORIGIN, 5.0)
    assert verdict.passed == (failed(verdict) == set())
    if verdict.fleet is not None:
        assert all(one.passed for one in heard.values())
        assert read(text_of(verdict.fleet).encode(), "fleet.yaml", FleetFile) == verdict.fleet


payloads = st.binary(max_size=128) | reports.map(pack)


@given(st.lists(st.tuples(st.sampled_from([1, 2, 9]), st.sampled_from([0xDC01, 0xDC04, 0xDC06]), payloads)))
def test_whatever_arrives_the_check_goes_on(heard: list[tuple[int, int, bytes]]) -> None:
    node = Preflight(Terms(1, companion(), ORIGIN, 5.0, 5.0, 7))
    codec = Codec()
    for k, (system, kind, payload) in enumerate(heard):
        data = codec.encode(Tunnel(Source(system, 195), 0, 0, kind, payload))
        for datagram in node.step(BEGIN + 10_000 * k, [Datagram("swarm", data), Datagram("autopilot", data)]):
            assert datagram.link in ("autopilot", "swarm")
    while not node.over:
        heard.append((0, 0, b""))
        node.step(BEGIN + 1_000_000 * len(heard), [])
    assert not node.verdict().passed


def test_the_same_run_gives_the_same_bytes() -> None:
    lossy = Faults(delay=4_000, jitter=8_000, loss=0.2)
    one, two = (text_of(fleet_file(Fleet(lossy, seed=seed))) for seed in (3, 3))
    assert one == two


def test_a_process_that_was_restarted_is_no_second_one() -> None:
    fleet = Fleet()
    fleet.loop.run(3_000_000)
    node = fleet.nodes["preflight-2"]
    node._terms = replace(node._terms, run=77)
    for verdict in fleet.run().values():
        assert failed(verdict) == set()
