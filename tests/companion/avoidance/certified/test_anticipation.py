"""Turn of the goal for encounters that are predicted."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.avoidance.certified.anticipation import anticipated_turn
from companion.config.certified import AnticipationConfig
from companion.values.bearings import turned
from companion.values.horizon import Array

CONFIG = AnticipationConfig(most=0.35)
WANTED, SECONDS = 1.25, 3.2
GOAL = np.array([8.0, 0.0, 5.0])
OWN = np.array([[-8.0, 0.0, 5.0], [-4.0, 0.0, 5.0]])
places = st.floats(-12.0, 12.0).map(lambda x: round(x, 3))
points = st.tuples(places, places, st.just(5.0))


def turn(others: Array, config: AnticipationConfig = CONFIG, sense: float = 1.0) -> float:
    return anticipated_turn(config, WANTED, OWN, others, GOAL, SECONDS, sense=sense)


def straight(begin: tuple[float, float], rest: tuple[float, float], height: float = 5.0) -> Array:
    return np.array([[[*begin, height], [*rest, height]]])


ONCOMING = straight((6.0, 0.0), (2.0, 0.0))


def test_two_that_meet_head_on_both_make_room() -> None:
    """Both turn by the same angle, and together, by 60 % each, by more than the distance that they want."""
    mine = turn(ONCOMING)
    theirs = anticipated_turn(CONFIG, WANTED, ONCOMING[0], OWN[None], -GOAL + [0, 0, 10], SECONDS, sense=1.0)
    assert mine == pytest.approx(theirs)
    assert 2.0 * 3.0 * np.tan(mine) >= CONFIG.wide * WANTED


@pytest.mark.parametrize(
    "others",
    [
        pytest.param(np.empty((0, 2, 3)), id="nobody"),
        pytest.param(straight((8.0, 0.0), (8.0, 0.0)), id="rests"),
        pytest.param(straight((6.0, 3.0), (2.0, 3.0)), id="passes on the side away from the turn"),
        pytest.param(straight((6.0, -3.0), (2.0, -3.0)), id="passes on the side of the turn"),
        pytest.param(straight((-9.0, 0.0), (-12.0, 0.0)), id="flies away"),
        pytest.param(straight((6.0, 0.0), (2.0, 0.0), 9.0), id="flies above"),
        pytest.param(straight((60.0, 0.0), (56.0, 0.0)), id="beyond the goal"),
    ],
)
def test_who_is_not_met_is_not_turned_away_from(others: Array) -> None:
    assert turn(others) == 0.0


@given(st.lists(st.tuples(points, points), max_size=5))
def test_the_turn_is_bounded_and_the_same_from_each_side(ends: list[tuple[tuple[float, ...], ...]]) -> None:
    """It does not depend on the order; a mirror changes the sense."""
    others = np.array(ends).reshape(-1, 2, 3)
    found = turn(others)
    assert 0.0 <= found <= CONFIG.most
    assert turn(others[::-1]) == found
    assert turn(others * (1.0, -1.0, 1.0), sense=-1.0) == pytest.approx(found)
    assert turn(others, AnticipationConfig(most=0.0)) == 0.0


@given(st.floats(-np.pi, np.pi))
def test_directions_of_the_axes_do_not_count(angle: float) -> None:
    def seen(rows: Array) -> Array:
        return np.array([turned(row, angle) for row in rows.reshape(-1, 3)]).reshape(rows.shape)

    found = anticipated_turn(CONFIG, WANTED, seen(OWN), seen(ONCOMING), seen(GOAL), SECONDS, sense=1.0)
    assert found == pytest.approx(turn(ONCOMING), abs=1e-6)


def test_who_flies_the_same_way_on_the_side_of_the_turn_does_not_count() -> None:
    """To turn with it would be to stay beside it."""
    assert turn(straight((-8.0, 1.5), (-3.0, -1.5))) == 0.0
