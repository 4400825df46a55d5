"""The bars of a sortie: a good flight passes them all, and each fault is named alone."""

from __future__ import annotations

import json

import pytest

from trials.measures import Spread
from trials.score import Score

GOOD = Score(
    tracking=Spread(0.05, 0.3, 0.8),
    true_tracking=Spread(0.5, 1.0, 2.0),
    estimate=Spread(0.5, 1.0, 2.0),
    step=0.02,
    standoff={"walk": Spread(0.1, 0.5, 0.9), "run": Spread(0.5, 1.5, 2.0)},
    true_standoff={"walk": Spread(0.5, 1.0, 1.5), "run": None},
    converged=14.0,
    truly_converged=None,
    anchored=0,
)
FAR = 1.9


def test_a_good_flight_passes() -> None:
    assert GOOD.faults(FAR) == []


@pytest.mark.parametrize(
    ("changed", "closest", "why"),
    [
        ({}, 1.49, "two vehicles were 1.49 m apart"),
        ({}, None, "two vehicles were no known number of m apart"),
        ({"tracking": Spread(0.1, 0.36, 0.5)}, FAR, "0.36 m off their set-points"),
        ({"tracking": None}, FAR, "off their set-points"),
        ({"step": 0.31}, FAR, "a set-point was 0.31 m beside where the last led"),
        ({"anchored": 1}, FAR, "1 plans began anew"),
        ({"anchored": None}, FAR, "nobody knows how many plans began anew"),
        ({"converged": 15.1}, FAR, "all were there 15.10 s after the go"),
        ({"converged": None}, FAR, "s after the go"),
        ({"standoff": {"walk": Spread(0.1, 0.61, 0.9)}}, FAR, "walking target 0.61 m"),
        ({"standoff": {}}, FAR, "walking target no known"),
    ],
)
def test_each_bar_is_named_alone(changed, closest, why: str) -> None:
    (fault,) = GOOD._replace(**changed).faults(closest)
    assert why in fault


def test_the_figures_are_json_with_what_is_not_known_as_null() -> None:
    found = json.loads(json.dumps(GOOD.document))
    assert found["tracking_error_m"] == {"p50": 0.05, "p95": 0.3, "max": 0.8}
    assert found["true_standoff_error_m"]["run"] is None
    assert found["truly_converged_s"] is None
