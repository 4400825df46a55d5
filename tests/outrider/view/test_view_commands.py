"""What is wished at a view, as bytes, as a pace, and as changes of a flight."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from outrider.scenarios.options import METHODS
from outrider.scene.changes import FILE, Change, Orders
from outrider.scene.view_commands import FASTEST, ViewCommands, decoded, encoded
from outrider.swarm.pace import LEASE, STEP, Pace

SHARES = st.floats(0.0, 1.0)
PLACES = st.tuples(*[st.floats(-1000.0, 1000.0)] * 3)
COUNTS = st.integers(0, 1000)
WISHES = st.builds(
    ViewCommands,
    speed=st.none() | st.floats(0.01, FASTEST),
    paused=st.booleans(),
    steps=COUNTS,
    methods=st.none() | st.lists(st.sampled_from(METHODS), min_size=1, unique=True).map("+".join),
    loss=st.none() | SHARES,
    target=st.none() | PLACES,
    moves=COUNTS,
)
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from(ViewCommands._fields), inner),
    max_leaves=10,
)


@given(WISHES)
def test_wishes_arrive_as_they_were_made(commands: ViewCommands) -> None:
    assert decoded(encoded(commands)) == commands


@given(st.binary() | JSON.map(lambda value: json.dumps(value).encode()))
def test_whatever_comes_is_a_wish_that_makes_sense_or_none(data: bytes) -> None:
    found = decoded(data)
    if found is not None:
        assert decoded(encoded(found)) == found
        assert set(found.method_names) <= set(METHODS)


class Wall:
    """A clock on the wall that goes on while one naps."""

    def __init__(self) -> None:
        self.now = 0.0

    def nap(self, seconds: float) -> None:
        self.now += seconds


def paced(wall: Wall) -> Pace:
    return Pace(lambda: wall.now, wall.nap)


def fly(pace: Pace, wall: Wall, seconds: float, commands: ViewCommands | None, begin: int = 0) -> None:
    """Ticks of 20 ms that take no time. Who is at the view says again and again what they wish."""

    def say(now: int) -> None:
        if commands is not None:
            pace.receive(commands, now)

    for now in range(begin, begin + round(1e6 * seconds), 20_000):
        say(now)
        pace.wait(now, lambda now=now: say(now))  # type: ignore[misc]


@given(st.floats(0.1, 50.0))
def test_a_simulation_goes_at_the_speed_that_is_wished(speed: float) -> None:
    wall = Wall()
    fly(paced(wall), wall, 10.0, ViewCommands(speed=speed))
    assert wall.now == pytest.approx(10.0 / speed, rel=0.01, abs=0.05)


@pytest.mark.parametrize("commands", [None, ViewCommands()])
def test_nobody_who_wishes_nothing_is_waited_for(commands: ViewCommands | None) -> None:
    wall = Wall()
    fly(paced(wall), wall, 10.0, commands)
    assert wall.now == 0.0


@pytest.mark.parametrize("commands", [ViewCommands(paused=True), ViewCommands(speed=0.01)])
def test_what_is_no_longer_said_no_longer_counts(commands: ViewCommands) -> None:
    """A view that is killed or hangs while the flight is paused holds it for the lease, and no longer."""
    wall = Wall()
    pace = paced(wall)
    pace.receive(commands, 0)
    fly(pace, wall, 10.0, None)
    assert LEASE <= wall.now < LEASE + 0.1


def test_a_step_goes_on_by_a_step() -> None:
    wall = Wall()
    pace = paced(wall)
    pace.receive(ViewCommands(paused=True), 0)
    pace.receive(ViewCommands(paused=True, steps=2), 0)
    for now in range(0, 2 * STEP, 20_000):
        pace.wait(now, lambda: None)
    assert wall.now == 0.0
    pace.wait(2 * STEP, lambda: None)
    assert wall.now >= LEASE


def test_one_that_cannot_keep_up_is_not_hurried_afterwards() -> None:
    wall = Wall()
    pace = paced(wall)
    fly(pace, wall, 1.0, ViewCommands(speed=1.0))
    wall.now += 5.0
    begin = wall.now
    fly(pace, wall, 2.0, ViewCommands(speed=1.0), begin=1_000_000)
    assert wall.now - begin == pytest.approx(2.0, abs=0.1)


def test_each_change_counts_once_and_is_kept(tmp_path: Path) -> None:
    orders = Orders()
    orders.write(tmp_path)
    assert not list(tmp_path.iterdir())
    said: list[ViewCommands] = [
        ViewCommands(paused=True),
        ViewCommands(methods="swivel"),
        ViewCommands(methods="swivel"),
        ViewCommands(methods="swivel", target=(1.0, 2.0, 3.0), moves=1),
        ViewCommands(methods="swivel", target=(1.0, 2.0, 3.0), moves=1, loss=0.5),
        ViewCommands(methods="swivel", target=(1.0, 2.0, 3.0), moves=2, loss=0.5),
    ]
    found = [orders.new(commands, float(at)) for at, commands in enumerate(said)]
    moved = Change(target=(1.0, 2.0, 3.0))
    assert found == [None, Change(methods="swivel"), None, moved, Change(loss=0.5), moved]
    orders.write(tmp_path)
    kept: list[dict[str, Any]] = json.loads((tmp_path / FILE).read_text())
    assert [one["time_s"] for one in kept] == [1.0, 3.0, 4.0, 5.0]
    assert kept[0] == {"time_s": 1.0, "methods": "swivel"}
