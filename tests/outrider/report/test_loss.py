"""Message loss out of logs in which all that was lost is known."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from outrider.report import clocks
from outrider.report.loss import LossComparison, Losses, LossRate, unwrapped
from outrider.report.reading import read
from outrider.report.run import Log, Run, Stream
from tests.outrider.report.runs import Lost, leave


def judged(run: Run) -> Losses:
    return in_order(run, run.logs)


def in_order(run: Run, logs: Iterable[Log]) -> Losses:
    assert run.motions is not None
    peers = LossComparison()
    for log in logs:
        peers.take(log, clocks.offset(log, run.motions))
    return peers.close()


def ways(run: Run) -> dict[tuple[int, int], LossRate]:
    return {(way.sender, way.receiver): way for way in judged(run).ways}


def some(sender: int, receiver: int, n: int) -> bool:
    """Every pair loses others, and other shares."""
    return (7 * n + sender) % (receiver - 6) == 0


def counted(lost: Lost, messages: int = 130) -> Counter[tuple[int, int]]:
    """Places are the even messages, and each tenth has a heartbeat behind it."""
    told = [2 * n for n in range(messages)] + [2 * n + 1 for n in range(0, messages, 10)]
    pairs = [(a, b) for a in (11, 12, 13) for b in (11, 12, 13) if a != b]
    return Counter({(a, b): sum(lost(a, b, n) for n in told) for a, b in pairs})


def test_whichever_log_comes_first(tmp_path: Path) -> None:
    run = read(leave(tmp_path, lost=some).directory)
    for of in (run.logs, run.logs[1:]):
        first = in_order(run, of)
        assert first.share
        for logs in permutations(of):
            found = in_order(run, logs)
            assert found.ways == first.ways
            assert found.since == first.since
            np.testing.assert_array_equal(found.by_second, first.by_second)


def test_the_matrix_is_what_was_lost(tmp_path: Path) -> None:
    run = read(leave(tmp_path, lost=some).directory)
    expected = counted(some)
    found = ways(run)
    assert {pair: way.lost for pair, way in found.items()} == dict(expected)
    assert all(way.exact and way.sent == 143 for way in found.values())


def test_nothing_lost(tmp_path: Path) -> None:
    found = judged(read(leave(tmp_path).directory))
    assert found.share == 0.0
    assert len(found.ways) == 6
    assert not np.nansum(found.by_second)


def test_clocks_that_differ_change_nothing(tmp_path: Path) -> None:
    late = {11: 4_000_000, 13: -700_000}
    straight = judged(read(leave(tmp_path / "a", lost=some).directory))
    crooked = judged(read(leave(tmp_path / "b", lost=some, late=late).directory))
    assert [way[:5] for way in crooked.ways] == [way[:5] for way in straight.ways]
    assert crooked.since == straight.since
    np.testing.assert_allclose(crooked.by_second, straight.by_second, atol=0.03)


def test_a_stamp_that_is_damaged_makes_no_flight_of_years(tmp_path: Path) -> None:
    run = read(leave(tmp_path, lost=some).directory)
    log, *others = run.logs
    for damaged in (1 << 61, -(1 << 61)):
        time = log.sent.time.copy()
        time[5] = damaged
        found = in_order(run, [log._replace(sent=log.sent._replace(time=time)), *others])
        assert len(found.by_second) < 60


def test_a_sender_without_a_log_is_judged_by_its_numbers(tmp_path: Path) -> None:
    directory = leave(tmp_path, lost=some).directory
    (directory / "vehicle-12.tlog").unlink()
    found = ways(read(directory))
    assert {pair for pair, way in found.items() if not way.exact} == {(12, 11), (12, 13)}
    for pair in ((12, 11), (12, 13)):
        # What was lost before the first that arrived, or after the last, leaves no gap.
        assert found[pair].lost == pytest.approx(counted(some)[pair], abs=3)
        assert found[pair].sent == pytest.approx(143, abs=3)


def test_who_hears_nothing_at_all_lost_everything(tmp_path: Path) -> None:
    def deaf(sender: int, receiver: int, n: int) -> bool:
        return receiver == 13

    found = ways(read(leave(tmp_path, lost=deaf).directory))
    assert found[11, 13].share == found[12, 13].share == 1.0
    assert found[11, 12].share == 0.0


def test_silence_lasts_from_message_to_message(tmp_path: Path) -> None:
    def cut(sender: int, receiver: int, n: int) -> bool:
        return sender == 11 and 100 <= n < 140  # tenths 50 to 69

    found = ways(read(leave(tmp_path, lost=cut).directory))
    assert found[11, 12].silence == pytest.approx(2.1, abs=1e-3)
    assert found[12, 11].silence == pytest.approx(0.1, abs=1e-3)
    assert found[12, 11].usual == pytest.approx(0.1, abs=1e-3)


def test_the_second_in_which_it_was_lost(tmp_path: Path) -> None:
    def cut(sender: int, receiver: int, n: int) -> bool:
        return 100 <= n < 120  # tenths 50 to 59: seconds 2 to 3 after the goal event

    found = judged(read(leave(tmp_path, lost=cut).directory))
    assert found.by_second[2 - found.since] == pytest.approx(1.0, abs=0.15)
    assert np.nansum(found.by_second) == pytest.approx(1.0, abs=0.15)


@given(st.lists(st.integers(1, 100), min_size=1, max_size=300), st.integers(0, 255))
def test_numbers_are_unwrapped(gaps: list[int], first: int) -> None:
    """Whatever is missing in between, as long as it is less than half a round."""
    true = first + np.concatenate([[0], np.cumsum(gaps)])
    time = 50_000 * true
    stream = Stream(time, true % 256, np.arange(len(true)))
    assert (unwrapped(stream) == true - first).all()


@given(st.lists(st.booleans(), min_size=2, max_size=200))
def test_messages_that_overtake_each_other_are_not_lost(swap: list[bool]) -> None:
    true = np.arange(2 * len(swap))
    for k, turned in enumerate(swap):
        if turned:
            true[[2 * k, 2 * k + 1]] = true[[2 * k + 1, 2 * k]]
    stream = Stream(50_000 * np.arange(len(true)), true % 256, true)
    assert (unwrapped(stream) == true - true[0]).all()


@given(st.integers(1, 20))
def test_a_silence_of_whole_rounds_is_seen_by_the_rate(rounds: int) -> None:
    true = np.concatenate([np.arange(100), np.arange(100) + 100 + 256 * rounds])
    stream = Stream(50_000 * true, true % 256, true)
    assert (unwrapped(stream) == true).all()
