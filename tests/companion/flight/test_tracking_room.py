"""Plan and compensation together ask for no more than the tilt gives."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.config.flight import TrackingConfig
from companion.flight.autopilots.ardupilot import ARDUPILOT
from companion.flight.tracking import Tracking
from companion.values.horizon import Motion

CONFIG = TrackingConfig(compensate=True)
ROOM = 3.0
PERIOD = 20_000


def followed(push, asked, room):
    """Compensations (T, 2) of 10 s under a push of the wind (2,) m/s², while plans ask for ``asked`` (2,)."""
    tracking = Tracking(CONFIG)
    tracking.keep(room)
    place, velocity, found = np.zeros(3), np.zeros(3), []
    wind, plan = np.append(push, 0.0), np.append(asked, 0.0)
    for k in range(500):
        # What the vehicle is asked for, what it gets, and a plan that begins where it is.
        tracking.observe(
            PERIOD * k, Motion(place, velocity, plan), Motion(place, velocity, plan), ARDUPILOT.loop
        )
        velocity = velocity + 1e-6 * PERIOD * (plan + tracking.compensation + wind)
        place = place + 1e-6 * PERIOD * velocity
        found.append(tracking.compensation[:2].copy())
    return np.array(found)


@given(
    push=st.tuples(st.floats(-4.0, 4.0), st.floats(-4.0, 4.0)),
    asked=st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0)),
)
def test_together_they_stay_within_what_there_is(push, asked):
    asked = np.array(asked)
    most = max(ROOM, float(np.hypot(*asked)))
    total = np.hypot(*(followed(np.array(push), asked, ROOM) + asked).T)
    assert total.max() <= most + 1e-9


def test_without_that_bound_they_would_not():
    """And with it all is used that there is."""
    push, asked = np.array([-3.0, 0.0]), np.array([2.0, 0.0])
    assert np.hypot(*(followed(push, asked, np.inf) + asked).T).max() > 4.0
    bounded = followed(push, asked, ROOM)
    assert bounded[-1] == pytest.approx([1.0, 0.0], abs=1e-6)


def test_where_there_is_room_nothing_changes():
    push, asked = np.array([-1.0, 0.5]), np.array([0.3, 0.2])
    np.testing.assert_array_equal(followed(push, asked, 9.0), followed(push, asked, np.inf))
