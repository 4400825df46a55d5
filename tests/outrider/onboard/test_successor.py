"""Who follows a process that was lost knows what that had found out, and tells the others at once where the
vehicle is."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from mavlink_bridge.clocks.clock import SimulatedClock
from mavlink_bridge.clocks.followed_clock import FollowedClock
from mavlink_bridge.messages import GpsGlobalOrigin, Heartbeat, LocalPosition, Source
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec
from outrider.onboard.flight import MOST
from outrider.onboard.process_channel import OrderLink, intercom
from outrider.onboard.request import Request
from outrider.onboard.status import StatusReports
from outrider.onboard.transmit_statistics import TransmitStatistics
from outrider.onboard.worker import Worker
from outrider.scenarios.fly_config import FleetOrigin, FlyConfig
from outrider.supervision.duplicate_ids import DuplicateIds
from outrider.supervision.supervised_node import SupervisedNode
from tests.outrider.onboard.supervised import flown

ORIGIN = (47.4, 8.5, 488.0)
CONFIG = FlyConfig(system=1, target=100, origin=FleetOrigin(latitude=47.4, longitude=8.5, altitude=488.0))
VEHICLE = Source(1, 1)


@pytest.fixture
def orders() -> Iterator[OrderLink]:
    desk, link = intercom()
    yield link
    desk.close()
    link.release()


@pytest.mark.parametrize("found", [None, False], ids=["the first", "after one that knew"])
def test_the_others_are_told_at_once_by_who_follows_one_that_knew(
    found: bool | None, orders: OrderLink
) -> None:
    wall = SimulatedClock(1_000_000)
    worker = Worker(Request(CONFIG, "px4", {}), {}, DuplicateIds(1, wall), orders, Path(), found)
    followed = worker.followed(wall)
    assert followed is not None
    supervised = SupervisedNode(worker.companion, wall, followed, None)
    news = StatusReports(
        supervised, TransmitStatistics(CONFIG.settings.limits), followed, None, lambda **_: None
    )
    codec, said = Codec(), 0
    for k in range(200):
        stamp = 5_000_000 + 10_000 * k
        received = [Heartbeat(VEHICLE, 2, 3, 0, 0, 3)] if k % 100 == 0 else []
        received.append(GpsGlobalOrigin(VEHICLE, *ORIGIN, stamp))
        received.append(LocalPosition(VEHICLE, stamp, (0.0, 0.0, -1.0), (0.0, 0.0, 0.0)))
        inbox = [Datagram("autopilot", codec.encode(message)) for message in received]
        said += sum(datagram.link == "swarm" for datagram in supervised.step(wall.now(), inbox))
        wall.wait_until(wall.now() + 10_000)
    assert (said >= 10) if found is False else (said == 0)
    assert news.state(wall.now()).simulated is found


@pytest.mark.parametrize("clock", ["auto", "autopilot", "wall"])
@pytest.mark.parametrize("found", [None, False, True])
def test_what_was_found_out_counts_where_it_was_to_be_found_out(
    clock: str, found: bool | None, orders: OrderLink
) -> None:
    config = FlyConfig.model_validate(CONFIG.model_dump() | {"clock": clock})
    worker = Worker(Request(config, "px4", {}), {}, DuplicateIds(1, SimulatedClock(1)), orders, Path(), found)
    followed = worker.followed(SimulatedClock(1))
    if clock == "wall":
        assert followed is None
    else:
        assert isinstance(followed, FollowedClock)
        assert followed.verdict is (True if clock == "autopilot" else found)


@pytest.mark.parametrize("found", [None, False, True])
def test_what_one_process_found_out_all_after_it_know(
    found: bool | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those too that follow one that was lost before it said a word."""
    known: list[bool | None] = []
    near, far = os.pipe()

    class Lost:
        """A process that ends as soon as it has begun; the second tells what it has found out."""

        sentinel, status, killed = near, -9, False

        def __init__(self, worker: Worker) -> None:
            self._worker = worker

        def start(self) -> int:
            clock = self._worker.followed(SimulatedClock(1))
            assert clock is not None
            known.append(clock.verdict)
            if len(known) == 2:
                self._worker._orders.tell(kind="state", simulated=found)
            self._worker._orders.tell(kind="fault", text=f"trouble {len(known)}")
            return 0

        def join(self) -> None:
            """It is gone."""

    over = flown(CONFIG, "px4", Lost, tmp_path, monkeypatch)
    os.close(near)
    os.close(far)
    assert over.fault
    assert known == [None, None, *[found] * (MOST - 2)]
    # What it said of its end was heard, too.
    assert [why for _, why in over.restarts] == [f"trouble {k + 1}" for k in range(MOST)]
