"""``outrider replay --certify`` on flown runs, with logs as they are, damaged, forged or missing."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from mavlink_bridge.messages import Tunnel
from mavlink_bridge.wire.agreements import PAYLOAD_TYPE as AGREEMENTS
from mavlink_bridge.wire.plan import PAYLOAD_TYPE
from outrider.certify.command import show
from outrider.certify.reading import read
from outrider.certify.verdict import judge
from outrider.scenarios.options import Options
from tests.outrider.certify.runs import LOSSY, PLANAR, SLOW, Replay, fly, rewrite


def plans_of(system: int) -> Callable[[Tunnel], bool]:
    return lambda tunnel: tunnel.payload_type == PAYLOAD_TYPE and tunnel.source.system == system


def states(system: int) -> Callable[[Tunnel], bool]:
    return lambda tunnel: tunnel.payload_type == AGREEMENTS and tunnel.source.system == system


def test_a_flight_is_certified(flown: Path, replay: Replay) -> None:
    ended = replay(flown, "--certify", "--json")
    assert (ended.status, ended.err) == (0, "")
    assert ended.out.count("\n") == 1
    said = json.loads(ended.out)
    assert said["certified"] is True
    assert said["findings"] == []
    assert said["vehicles"] == 3
    assert said["epochs"] > 20
    assert said["pairs"] == 3 * said["epochs"] - said["unchecked"]["resting"]
    # They have passed each other.
    assert said["required_m"] - 1e-6 <= said["least_m"] < 1.5
    assert said["plans"] > 40
    assert (said["anchors"], said["farewells"], said["damaged_records"]) == (0, 0, 0)


def test_for_people_it_is_a_table(flown: Path, replay: Replay) -> None:
    ended = replay(flown, "--certify")
    assert (ended.status, ended.err) == (0, "")
    for words in ("certified", "pairs of plans checked", "least distance", "carried on", "farewells"):
        assert words in ended.out
    assert "{" not in ended.out


def test_the_line_of_the_verdict_is_whole_for_a_name_of_any_length(
    flown: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    verdict = judge(read(flown, lambda _what, _share: None))
    for length in range(1, 200):
        show("a" * length, verdict)
        assert capsys.readouterr().out.startswith("a" * length + " · certified\n")


@pytest.mark.slow
def test_who_lands_says_farewell(tmp_path: Path) -> None:
    run = fly(tmp_path / "run", 2, airborne=False)
    said = judge(read(run, lambda _what, _share: None)).document()
    assert said["certified"], said["findings"]
    assert said["farewells"] == 2


@pytest.mark.parametrize("number", [0, 40])
@pytest.mark.parametrize("owner", [11, 12])
def test_one_bit_of_one_plan_is_found(owner: int, number: int, run: Path, replay: Replay) -> None:
    """In the sender's own log or in that of who heard it; checksums hold."""
    seen = 0

    def forge(tunnel: Tunnel) -> Tunnel:
        nonlocal seen
        if not plans_of(11)(tunnel):
            return tunnel
        seen += 1
        if seen != number + 1:
            return tunnel
        payload = bytearray(tunnel.payload)
        # A bit of the first place: the plan looks as sound as before.
        payload[12] ^= 1
        return tunnel._replace(payload=bytes(payload))

    rewrite(run / f"vehicle-{owner}.tlog", forge)
    ended = replay(run, "--certify", "--json")
    assert ended.status == 1
    found = json.loads(ended.out)["findings"]
    assert any("1 bit differs" in one["figures"] and 11 in one["who"] for one in found)
    for one in found:
        assert -1.0 < one["when_s"] < 60.0
    ended = replay(run, "--certify")
    assert ended.status == 1
    assert "not certified" in ended.out
    assert "1 bit differs" in ended.out


def test_a_log_that_is_left_as_it_was_copied_is_certified(run: Path, replay: Replay) -> None:
    """So that what is found in forged logs is what was forged."""
    rewrite(run / "vehicle-11.tlog", lambda tunnel: tunnel)
    assert replay(run, "--certify").status == 0


def test_lost_copies_change_nothing_but_a_lost_plan_is_found(run: Path, replay: Replay) -> None:
    seen: set[bytes] = set()

    def once(tunnel: Tunnel) -> Tunnel | None:
        if not plans_of(11)(tunnel):
            return tunnel
        again = tunnel.payload in seen
        seen.add(tunnel.payload)
        return None if again else tunnel

    rewrite(run / "vehicle-11.tlog", once)
    assert replay(run, "--certify").status == 0
    lost = sorted(seen)[len(seen) // 2]
    rewrite(run / "vehicle-11.tlog", lambda tunnel: None if tunnel.payload == lost else tunnel)
    ended = replay(run, "--certify", "--json")
    assert ended.status == 1
    (finding,) = json.loads(ended.out)["findings"]
    assert finding["who"] == [11, 12, 13]
    assert "did not send" in finding["what"]


def test_what_a_vehicle_has_not_heard_it_cannot_count_on(run: Path, replay: Replay) -> None:
    """The statements of 12 are gone from the log of 11, which made its plans nevertheless."""
    rewrite(run / "vehicle-11.tlog", lambda tunnel: None if states(12)(tunnel) else tunnel)
    ended = replay(run, "--certify", "--json")
    assert ended.status == 1
    found = json.loads(ended.out)["findings"]
    assert {"a plan without an agreement", "an agreement dropped"} == {one["what"] for one in found}
    assert all(one["who"] == [11, 12] for one in found)


def test_a_vehicle_that_states_nothing_is_found(run: Path, replay: Replay) -> None:
    for log in run.glob("*.tlog"):
        rewrite(log, lambda tunnel: None if states(13)(tunnel) else tunnel)
    ended = replay(run, "--certify", "--json")
    assert ended.status == 1
    found = json.loads(ended.out)["findings"]
    assert [13, 11, 12] in [one["who"] for one in found if one["what"] == "a plan without a statement"]


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "options"), [(1, PLANAR), (1, LOSSY), (2, LOSSY), (3, SLOW)])
def test_flights_with_loss_and_delay_are_certified(seed: int, options: Options, tmp_path: Path) -> None:
    run = fly(tmp_path / "run", 4, seed=seed, options=options)
    said = judge(read(run, lambda _what, _share: None)).document()
    assert said["findings"] == []
    assert said["agreements"] > 100
    # Each plan keeps at least one agreement with each of the three others.
    assert said["planes_checked"] >= 3 * said["plans"]
