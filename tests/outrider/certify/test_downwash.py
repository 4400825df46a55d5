"""The check of a flight divides differences in height by the downwash of its fleet."""

from __future__ import annotations

import pytest

from outrider.certify.verdict import judge
from tests.outrider.certify.evidence import TERMS, evidence, on, standing


@pytest.mark.parametrize(("downwash", "nearest"), [(1.0, 2.0), (2.0, 1.0)])
def test_vehicles_above_each_other_are_nearer(downwash: float, nearest: float) -> None:
    sent = {}
    for system, height in ((11, 5.0), (12, 7.0)):
        plans = [standing((0.0, 0.0, height))]
        plans += [on(plans[0], count) for count in range(1, 5)]
        sent[system] = plans
    verdict = judge(evidence(sent, TERMS._replace(downwash=downwash)))
    assert verdict.pairs.nearest is not None
    assert verdict.pairs.nearest.distance == pytest.approx(nearest, abs=1e-3)
