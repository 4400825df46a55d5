"""Two processes look after each other: who hangs is found, and who was only held up is not."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from outrider.onboard.process_channel import PARENT_TIMEOUT_S, Channel, OrderLink, intercom
from outrider.onboard.watchdog import FIRST, HUNG, Watchdog

LOOK = 0.05


def looked(watchdog: Watchdog, begin: float, seconds: float) -> float | None:
    """When (s since ``begin``) it was found stopped, looked at all the time."""
    for k in range(1, round(seconds / LOOK) + 1):
        if watchdog.stopped(begin + k * LOOK):
            return k * LOOK
    return None


def test_the_first_news_may_take_its_time_and_the_next_may_not() -> None:
    watchdog = Watchdog(100.0)
    assert looked(watchdog, 100.0, FIRST) is None
    assert looked(Watchdog(100.0), 100.0, 60.0) == pytest.approx(FIRST, abs=2 * LOOK)
    watchdog.received(110.0)
    assert looked(watchdog, 110.0, 60.0) == pytest.approx(HUNG, abs=2 * LOOK)


def test_who_was_held_up_himself_judges_nobody() -> None:
    watchdog = Watchdog(0.0)
    now = 0.0
    for _ in range(20):
        watchdog.received(now)
        now += 30.0
        assert not watchdog.stopped(now)
        # What waited is heard then.
    assert looked(watchdog, now, 60.0) == pytest.approx(HUNG, abs=2 * LOOK)


@pytest.fixture
def ends() -> Iterator[tuple[Channel, OrderLink]]:
    desk, orders = intercom()
    yield desk, orders
    desk.close()
    orders.release()


def test_a_child_whose_parent_stands_still_is_alone(
    ends: tuple[Channel, OrderLink], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It has been stopped, or waits for a terminal: its process is still there."""
    desk, orders = ends
    now = 50.0
    monkeypatch.setattr(orders, "_clock", lambda: now)
    for _ in range(100):
        desk.beat(now)
        assert orders.receive() == []
        assert not orders.alone
        now += 0.1
    now += PARENT_TIMEOUT_S - 1.0
    assert not orders.alone
    now += 2.0
    assert orders.alone


def test_beats_leave_room_for_orders(ends: tuple[Channel, OrderLink]) -> None:
    desk, orders = ends
    for k in range(100):
        desk.beat(10.0 + 0.01 * k)
    desk.order(b"land")
    assert orders.receive() == [b"land"]
