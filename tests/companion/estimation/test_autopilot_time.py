"""UTC of the autopilot is inside the interval, whatever the delays, for every clock that keeps its bounds."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.config.certified import TimeSourcesConfig
from companion.estimation.autopilot_time import AutopilotTime
from companion.estimation.time_sync import RoundTrips
from mavlink_bridge.messages import Source, SystemTime, Timesync

OWN, AUTOPILOT = Source(1, 195), Source(1, 1)
TRUE = 1_767_225_600_000_000
"""UTC at which the autopilot boots."""
SECOND = 1_000_000
ERROR = 20_000
CONFIG = TimeSourcesConfig(autopilot_us=ERROR)


class Pair:
    """A companion and its autopilot, each with a clock of its own; ``true`` is UTC."""

    def __init__(self, ahead: int = 0, own_ppm: int = 0, boot_ppm: int = 0, error: int = 0) -> None:
        self.true, self._ahead, self._own_ppm, self._boot_ppm = TRUE, ahead, own_ppm, boot_ppm
        self.booted, self.error = TRUE, error
        self.time = AutopilotTime(OWN, CONFIG)

    @property
    def own(self) -> int:
        return self.true + self._ahead + (self.true - TRUE) * self._own_ppm // SECOND

    @property
    def boot(self) -> int:
        passed = self.true - self.booted
        return passed + passed * self._boot_ppm // SECOND

    def tell(self, delay: int = 0) -> None:
        """SYSTEM_TIME: the autopilot's UTC runs on its own oscillator."""
        message = SystemTime(AUTOPILOT, self.booted + self.boot + self.error, self.boot // 1000 * 1000)
        self.true += delay
        self.time.receive(self.own, message)

    def ask(self, there: int, back: int) -> None:
        for request in self.time.due(self.own):
            self.true += there
            answer = Timesync(AUTOPILOT, max(1, self.boot * 1000), request.ts1)
            self.true += back
            self.time.receive(self.own, answer)

    @property
    def inside(self) -> bool:
        found = self.time.offset(self.own)
        return found is not None and found.least <= self.true - self.own <= found.most


delays = st.integers(0, 400_000)


@given(
    st.integers(-600 * SECOND, 600 * SECOND),
    st.integers(-50, 50),
    st.integers(-50, 50),
    st.integers(-ERROR, ERROR),
    st.lists(st.tuples(st.integers(0, 5 * SECOND), delays, delays, delays), min_size=1, max_size=12),
)
def test_utc_is_inside_whatever_the_delays(
    ahead: int, own_ppm: int, boot_ppm: int, error: int, rounds: list[tuple[int, int, int, int]]
) -> None:
    pair = Pair(ahead, own_ppm, boot_ppm, error)
    for pause, delay, there, back in rounds:
        pair.true += pause
        pair.tell(delay)
        pair.ask(there, back)
        assert pair.time.offset(pair.own) is None or pair.inside
    pair.true += SECOND
    pair.tell()
    pair.ask(10_000, 10_000)
    assert pair.inside


def test_the_bound_is_half_the_round_trip_and_the_autopilots_own() -> None:
    pair = Pair()
    pair.tell()
    pair.ask(20_000, 20_000)
    found = pair.time.offset(pair.own)
    assert found is not None
    assert 20_000 <= found.bound - ERROR <= 22_000


@pytest.mark.parametrize("unix", [0, 315_964_800_000_000, 2**64 - 1], ids=["none", "1980", "far"])
def test_an_autopilot_without_the_time_says_nothing(unix: int) -> None:
    pair = Pair()
    pair.ask(10_000, 10_000)
    pair.tell()
    assert pair.inside
    pair.time.receive(pair.own, SystemTime(AUTOPILOT, unix, pair.boot))
    assert pair.time.offset(pair.own) is None


def test_after_a_reboot_the_old_clock_is_not_mixed_with_the_new_one() -> None:
    """Whichever comes first of the new one, SYSTEM_TIME or an answer."""
    for first in ("time", "answer"):
        pair = Pair()
        pair.true += 100 * SECOND
        pair.tell()
        pair.ask(10_000, 10_000)
        assert pair.inside
        pair.true += 3 * SECOND
        pair.booted = pair.true - SECOND
        if first == "time":
            pair.tell()
        else:
            pair.ask(10_000, 10_000)
        assert pair.time.offset(pair.own) is None
        pair.true += SECOND
        pair.tell()
        pair.ask(10_000, 10_000)
        assert pair.inside


def test_what_is_old_is_not_used() -> None:
    pair = Pair()
    pair.tell()
    pair.ask(10_000, 10_000)
    pair.true += 9 * SECOND
    assert pair.inside
    pair.true += 2 * SECOND
    assert pair.time.offset(pair.own) is None


def test_a_foreign_answer_is_not_taken_and_no_request_is_one_of_the_companions_others() -> None:
    pair = Pair()
    pair.tell()
    pair.time.receive(pair.own, Timesync(AUTOPILOT, 5, 5))
    assert pair.time.offset(pair.own) is None
    (mine,), (other,) = pair.time.due(pair.own), RoundTrips(OWN).due(pair.own, 1_000_000)
    assert mine.ts1 != other.ts1


def test_without_a_bound_of_its_error_the_autopilot_is_not_asked() -> None:
    time = AutopilotTime(OWN, TimeSourcesConfig())
    assert time.due(TRUE) == []
    time.receive(TRUE, SystemTime(AUTOPILOT, TRUE, 0))
    assert time.offset(TRUE) is None
