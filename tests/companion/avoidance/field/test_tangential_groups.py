"""The tangential band about several at once: what has no way through is passed as one."""

from __future__ import annotations

from copy import deepcopy

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from companion.config.planning import TangentialConfig
from tests.companion.band import NOTHING, force, method, scene
from tests.companion.rig import LAWS, obstacles

CONFIG = TangentialConfig()
APART, TOGETHER = ([[2.0, side * off, 0.0] for side in (1.0, -1.0)] for off in (1.7, 0.7))
"""One on the left and one on the right, as heavy as each other: with a way between them, and without."""
CORNERS = [[2.0, side * 1.2, height] for side in (1.0, -1.0) for height in (0.3, -0.3)]
"""Where others come to them, all as heavy as each other."""


@pytest.mark.parametrize("shift", [-0.4, 0.4])
def test_a_row_with_no_way_through_is_passed_as_one(shift):
    """Each alone would be left on its own side, and the forces would cancel between the two."""
    row = obstacles([[2.0, shift + 0.7, 0.0], [2.0, shift - 0.7, 0.0]])
    f = force(row)[0]
    assert abs(f[1]) > CONFIG.force_max / 2
    # The middle of the row is to the left if it is shifted there: it is passed on its right.
    assert np.sign(f[1]) == -np.sign(shift)
    wide = obstacles([[2.0, shift + 1.7, 0.0], [2.0, shift - 1.7, 0.0]])
    assert abs(force(wide)[0][1]) < abs(f[1])


def test_who_joins_a_group_is_passed_as_the_group_is():
    method_ = method()
    one, two = [[2.0, 0.3, 0.0]], [[2.0, 0.3, 0.0], [2.0, -2.0, 0.0]]
    first = method_.influence(scene(obstacles(one)), NOTHING).force[0]
    second = method_.influence(scene(obstacles(two)), NOTHING).force[0]
    assert np.sign(first[1]) == np.sign(second[1]) == -1.0


def joined(rows):
    """The force (3,) when the two, latched apart, have drawn together and others have come to them, and each
    one's sense (1: it stays on the left). ``rows`` (id, place) are of all; the two have ids 1 and 2."""
    band = method()
    band.influence(scene(obstacles(APART)), NOTHING)
    names, places = zip(*rows, strict=True)
    f = band.influence(scene(obstacles(places)._replace(ids=names)), NOTHING).force[0]
    return f, {name: latched(band, name) for name in names}


def latched(band, name):
    """Who has a sense keeps it, when alone, on either side of the course."""
    alone = [obstacles([[2.0, side, 0.0]])._replace(ids=(name,)) for side in (0.1, -0.1)]
    north = [deepcopy(band).influence(scene(one), NOTHING).force[0][1] for one in alone]
    assert np.sign(north[0]) == np.sign(north[1])
    return -np.sign(north[0])


@LAWS
@given(places=st.lists(st.sampled_from(CORNERS), min_size=1, max_size=4), data=st.data())
def test_who_comes_to_two_senses_of_one_weight_takes_the_side_of_most(places, data):
    """In whatever order the obstacles are listed; who has a sense keeps it."""
    side = np.sign(sum(place[1] for place in places))
    assume(side != 0.0)
    rows = list(enumerate([*TOGETHER, *places], 1))
    f, senses = joined(rows)
    assert senses == {1: 1.0, 2: -1.0} | {name: side for name, _ in rows[2:]}
    g, same = joined(data.draw(st.permutations(rows)))
    assert same == senses
    np.testing.assert_allclose(g, f, atol=1e-9)
