"""Laws of the loop under a clock that does not wait: the grid is kept, who is late skips, all is counted."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mavlink_bridge.clocks.clock import SimulatedClock, WallClock
from mavlink_bridge.clocks.node_clock import NodeClock
from mavlink_bridge.errors import BridgeError, ScheduleError
from mavlink_bridge.links.endpoints import UdpIn, UdpOut
from mavlink_bridge.links.link import Link, LinkCounters, MemoryLink, memory_pair
from mavlink_bridge.links.udp import UdpCaller, UdpListener
from mavlink_bridge.loops.inbox import Inbox
from mavlink_bridge.loops.lockstep import Scheduled
from mavlink_bridge.loops.realtime import RealTime, Statistics
from mavlink_bridge.node import Datagram
from tests.mavlink_bridge.link_pairs import HOST, frame, udp
from tests.mavlink_bridge.watching import Watcher

PERIOD, PHASE = 10_000, 2_000


def never() -> bool:
    return False


class Sleeper(SimulatedClock):
    """Wakes its users late, by the next of ``delays`` (µs)."""

    def __init__(self, start: int, delays: Sequence[int] = ()) -> None:
        super().__init__(start)
        self._delays = list(delays)

    def wait_until(self, instant: int) -> None:
        late = self._delays.pop(0) if self._delays else 0
        super().wait_until(max(instant, self.now()) + late)

    def spend(self, duration: int) -> None:
        """Somebody works."""
        super().wait_until(self.now() + duration)


class Worker:
    """Takes the next of ``durations`` (µs) for each step, answers all it hears, and remembers."""

    name = "worker"

    def __init__(self, clock: Sleeper, durations: Sequence[int] = ()) -> None:
        self._clock = clock
        self._durations = list(durations)
        self.told: list[int] = []
        self.began: list[int] = []
        self.received: list[Datagram] = []

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        self.told.append(now)
        self.began.append(self._clock.now())
        self.received += inbox
        if self._durations:
            self._clock.spend(self._durations.pop(0))
        return [Datagram(link, b"re: " + data) for link, data in inbox]


def until(worker: Worker, steps: int) -> Callable[[int], bool]:
    return lambda _now: len(worker.told) >= steps


def run(clock: Sleeper, worker: Worker, steps: int, tolerance: int | None = None) -> Statistics:
    loop = RealTime(Scheduled(worker, PERIOD, PHASE), {}, clock, tolerance=tolerance)
    return loop.run(never, until(worker, steps))


SPELLS = st.lists(st.one_of(st.integers(0, 3_000), st.integers(0, 60_000)), min_size=1, max_size=40)


@given(SPELLS, SPELLS, st.integers(0, 10**6), st.sampled_from([None, 500, 15_000]))
def test_the_grid_is_kept_whatever_happens(
    delays: list[int], durations: list[int], start: int, tolerance: int | None
) -> None:
    clock = Sleeper(start, delays)
    worker = Worker(clock, durations)
    statistics = run(clock, worker, 60, tolerance)
    first = worker.told[0]
    for told, began in zip(worker.told, worker.began, strict=True):
        assert (told - PHASE) % PERIOD == 0
        assert told % 4 == 0
        # The latest deadline that has passed.
        assert 0 <= began - told < PERIOD
    assert all(one < following for one, following in pairwise(worker.told))
    assert statistics.steps == 60
    # Each deadline has a step of its own or is counted as skipped, from the first that was not past.
    awaited = start + (PHASE - start) % PERIOD if start > PHASE else PHASE
    assert statistics.steps + statistics.skipped == (worker.told[-1] - awaited) // PERIOD + 1
    waited = [awaited, *(told + PERIOD for told in worker.told[:-1])]
    lateness = [began - deadline for began, deadline in zip(worker.began, waited, strict=True)]
    assert min(lateness) >= 0
    limit = PERIOD if tolerance is None else tolerance
    assert statistics.misses == sum(late > limit for late in lateness)
    assert statistics.lateness.max == max(lateness)
    assert statistics.busy.max == max([*durations[:60], 0])
    assert first >= awaited


@given(st.integers(0, PERIOD - 1), st.integers(1, 300))
def test_who_is_always_a_little_late_does_not_drift(late: int, steps: int) -> None:
    clock = Sleeper(0, [late] * 1000)
    worker = Worker(clock)
    statistics = run(clock, worker, steps)
    assert worker.told == [PHASE + k * PERIOD for k in range(steps)]
    assert (statistics.misses, statistics.skipped) == (0, 0)


def test_a_long_stall_is_followed_by_one_step_and_not_by_a_burst() -> None:
    clock = Sleeper(0)
    worker = Worker(clock, [0, 95_000, 0, 0])
    statistics = run(clock, worker, 5)
    assert worker.told == [2_000, 12_000, 102_000, 112_000, 122_000]
    assert worker.began == [2_000, 12_000, 107_000, 112_000, 122_000]
    assert (statistics.misses, statistics.skipped) == (1, 8)


def test_who_was_held_up_on_purpose_is_not_late() -> None:
    """The stall of one step delays the next, which is excused: it counts nowhere, and all others do."""
    clock = Sleeper(0)
    worker = Worker(clock, [0, 95_000, 0, 2_500, 0])
    loop = RealTime(
        Scheduled(worker, PERIOD, PHASE), {}, clock, tolerance=500, excused=lambda: len(worker.told) == 2
    )
    statistics = loop.run(never, until(worker, 5))
    assert worker.told == [2_000, 12_000, 102_000, 112_000, 122_000]
    assert (statistics.steps, statistics.misses, statistics.skipped) == (4, 0, 0)
    assert statistics.lateness.max == 0


def test_the_start_may_be_far_ahead_and_given_up() -> None:
    clock = Sleeper(0)
    worker = Worker(clock)
    asked = []

    def stop() -> bool:
        asked.append(clock.now())
        return clock.now() > 3_000_000

    RealTime(Scheduled(worker, PERIOD, 10**9), {}, clock).run(stop)
    assert worker.told == []
    assert clock.now() < 3_200_000


def test_nothing_is_done_after_stop() -> None:
    clock = Sleeper(0)
    worker = Worker(clock)
    RealTime(Scheduled(worker, PERIOD, PHASE), {}, clock).run(lambda: clock.now() >= PHASE + 3 * PERIOD)
    assert worker.told == [PHASE + k * PERIOD for k in range(3)]


@given(st.integers(-(10**6), 10**6), st.integers(-500, 500))
@settings(max_examples=30)
def test_a_node_lives_by_its_own_clock(offset: int, drift_ppm: int) -> None:
    true = Sleeper(10**9)
    worker = Worker(true)
    skew = NodeClock(offset, float(drift_ppm), 10**9)
    seen: list[int] = []

    def on_step(now: int) -> bool:
        seen.append(now)
        return len(seen) == 200

    RealTime(Scheduled(worker, PERIOD, 10**9 + PHASE, skew), {}, true).run(never, on_step)
    assert all((told - PHASE) % PERIOD == 0 for told in worker.told)
    assert all(following - one == PERIOD for one, following in pairwise(worker.told))
    assert seen == [skew.instant(told) for told in worker.told] == worker.began
    assert 10**9 + PHASE <= seen[0] <= 10**9 + PHASE + PERIOD + 10


@pytest.mark.parametrize(("period", "phase"), [(0, 0), (-4, 0), (10_002, 0), (10_000, 2), (10_000, -4)])
def test_what_is_off_the_grid_is_refused(period: int, phase: int) -> None:
    clock = Sleeper(0)
    with pytest.raises(ScheduleError, match="worker"):
        RealTime(Scheduled(Worker(clock), period, phase), {}, clock)


# Links


def test_a_name_may_stand_for_several_links_or_for_none() -> None:
    clock = Sleeper(0)
    worker = Worker(clock)
    (a, far_a), (b, far_b), (c, far_c) = memory_pair(), memory_pair(), memory_pair()
    far_a.send(b"1")
    far_b.send(b"2")
    far_c.send(b"3")
    loop = RealTime(Scheduled(worker, PERIOD, PHASE), {"swarm": [a, b], "ground": c, "target": []}, clock)
    loop.run(never, until(worker, 1))
    assert worker.received == [Datagram("swarm", b"1"), Datagram("swarm", b"2"), Datagram("ground", b"3")]
    assert far_a.receive() == far_b.receive() == [b"re: 1", b"re: 2"]
    assert far_c.receive() == [b"re: 3"]
    assert loop.statistics.unrouted == 0


class Shouter(Worker):
    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        super().step(now, inbox)
        return [Datagram("nowhere", b"?"), Datagram("somewhere", b"!")]


def test_what_leads_nowhere_is_counted() -> None:
    clock = Sleeper(0)
    worker = Shouter(clock)
    near, far = memory_pair()
    loop = RealTime(Scheduled(worker, PERIOD, PHASE), {"somewhere": near}, clock)
    assert loop.run(never, until(worker, 3)).unrouted == 3
    assert far.receive() == [b"!"] * 3


def test_of_too_much_the_oldest_is_dropped_and_counted() -> None:
    clock = Sleeper(0)
    worker = Worker(clock)
    near, far = memory_pair()
    for number in range(10):
        far.send(bytes([number]))
    loop = RealTime(Scheduled(worker, PERIOD, PHASE), {"swarm": near}, clock, capacity=4)
    assert loop.run(never, until(worker, 2)).overruns == 6
    assert [data for _, data in worker.received] == [bytes([number]) for number in range(6, 10)]


def test_taps_see_all_with_the_time_that_the_node_was_told() -> None:
    clock = Sleeper(0, [100] * 50)
    worker = Worker(clock)
    near, far = memory_pair()
    watcher = Watcher()
    loop = RealTime(Scheduled(worker, PERIOD, PHASE), {"swarm": near}, clock, [watcher])

    def on_step(now: int) -> bool:
        far.send(str(now).encode())
        return len(worker.told) == 4

    loop.run(never, on_step)
    ways = [("in", ""), ("out", "re: ")]
    assert watcher.steps == [(now, "worker") for now in worker.told]
    assert watcher.events == [
        (now + PERIOD, "worker", way, Datagram("swarm", f"{before}{now}".encode()))
        for now in worker.told[:3]
        for way, before in ways
    ]


class Fallen(Worker):
    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        if inbox:
            raise ArithmeticError("one too many")
        return []


def test_a_fault_of_the_node_is_not_hidden_and_its_cause_is_logged() -> None:
    clock = Sleeper(0)
    near, far = memory_pair()
    far.send(b"1")
    watcher = Watcher()
    loop = RealTime(
        Scheduled(Fallen(clock), PERIOD, PHASE),
        {"swarm": near},
        clock,
        [watcher],
    )
    with pytest.raises(ArithmeticError):
        loop.run(never)
    assert [event[3] for event in watcher.events] == [Datagram("swarm", b"1")]
    near.send(b"2")
    assert far.receive() == []


def test_idle_time_is_what_is_left_until_the_next_deadline() -> None:
    clock = Sleeper(0)
    worker = Worker(clock, [1_000, 4_000, 25_000, 0])
    left: list[int] = []
    loop = RealTime(Scheduled(worker, PERIOD, PHASE), {}, clock, on_idle=left.append)
    loop.run(never, until(worker, 5))
    # The fourth step, due at 32 000, begins at 47 000 as that of 42 000.
    assert left == [9_000, 6_000, -15_000, 5_000]


# Under the wall clock: whether it ends well, not when


def test_two_loops_talk_over_sockets_and_leave_nothing() -> None:
    clock, threads = WallClock(), threading.active_count()
    listener = UdpListener(UdpIn(HOST, 0), clock)
    caller = UdpCaller(UdpOut(HOST, listener.address[1]))
    stop = threading.Event()
    start = clock.now() // 4 * 4

    class Talker:
        def __init__(self, name: str) -> None:
            self.name = name
            self.received = 0
            self.times: list[int] = []

        def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
            self.received += len(inbox)
            self.times.append(now)
            return [Datagram("link", frame(len(self.times)))]

    talkers = [Talker("a"), Talker("b")]
    loops = [
        RealTime(Scheduled(talker, 1_000, start), {"link": link}, WallClock(clock.offset_ns))
        for talker, link in zip(talkers, (listener, caller), strict=True)
    ]
    other = threading.Thread(target=loops[1].run, args=(stop.is_set,))
    other.start()
    loops[0].run(stop.is_set, lambda _now: all(talker.received >= 20 for talker in talkers))
    stop.set()
    other.join()
    assert threading.active_count() == threads
    for talker, loop in zip(talkers, loops, strict=True):
        assert talker.received >= 20
        assert all((now - start) % 1_000 == 0 for now in talker.times)
        assert loop.statistics.steps == len(talker.times)
        assert loop.statistics.overruns == 0
    for link in (listener, caller):
        link.send(b"late")
        assert link.counters.dropped >= 1


class Deaf:
    """A link that breaks, as no link should, whoever reads it beside the loop."""

    def __init__(self, link: Link) -> None:
        self._link = link

    counters = LinkCounters(0, 0, 0)

    def fileno(self) -> int | None:
        return self._link.fileno()

    def receive(self) -> list[bytes]:
        if threading.current_thread() is threading.main_thread():
            return self._link.receive()
        raise MemoryError("no link raises, but")

    def send(self, data: bytes) -> None:
        self._link.send(data)

    def close(self) -> None:
        self._link.close()


class Slow(Deaf):
    """A link that takes its time to receive."""

    def __init__(self, link: Link) -> None:
        super().__init__(link)
        self.entered, self.released, self.left = (threading.Event() for _ in range(3))

    def receive(self) -> list[bytes]:
        self.entered.set()
        self.released.wait()
        found = self._link.receive()
        self.left.set()
        return found


def test_a_closed_inbox_touches_no_link_any_more() -> None:
    """Or the links would be closed under the hands of its thread."""
    pair = udp()
    link = Slow(pair.there)
    inbox = Inbox([("link", link)])
    pair.here.send(frame(1))
    link.entered.wait()
    closing = threading.Thread(target=inbox.close)
    closing.start()
    closing.join(0.1)  # in vain, as the law says; without the law, long enough
    assert closing.is_alive()
    link.released.set()
    closing.join()
    assert link.left.is_set()
    inbox.close()
    for end in pair:
        end.close()


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_nobody_flies_deaf() -> None:
    pair = udp()
    clock = WallClock()
    worker = Worker(Sleeper(0))
    loop = RealTime(Scheduled(worker, 1_000, 0), {"link": Deaf(pair.there)}, clock)
    pair.here.send(frame(1))
    with pytest.raises(BridgeError, match="thread has ended"):
        loop.run(never)
    pair.here.close()


def test_the_in_memory_link_needs_no_thread() -> None:
    near, _ = memory_pair()
    assert isinstance(near, MemoryLink)
    clock, threads = Sleeper(0), threading.active_count()
    worker = Worker(clock)
    loop = RealTime(Scheduled(worker, PERIOD, PHASE), {"link": near}, clock)
    loop.run(never, lambda _now: threading.active_count() > threads or len(worker.told) == 3)
    assert len(worker.told) == 3
