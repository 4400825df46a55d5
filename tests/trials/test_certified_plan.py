"""The plan of a certified trial: who flies, how far apart, and what the plans allow for."""

from __future__ import annotations

import argparse
from itertools import pairwise

import pytest

from companion.avoidance.certified.margins import between
from companion.config import CompanionConfig
from outrider.errors import InputError
from trials.autopilots import Program, autopilots
from trials.certified import planned
from trials.certified_plan import MIXED, SPACING, CertifiedPlan

ASKED = {
    "kind": MIXED,
    "count": 5,
    "flights": 2,
    "seed": 7,
    "loss": 0.1,
    "signed": False,
    "victims": [],
    "tube": 1.5,
    "sigma": 0.3,
    "sensors": "truth",
    "autopilots": [],
}


def asked(**changes: object) -> argparse.Namespace:
    return argparse.Namespace(**(ASKED | changes))


def test_real_firmware_flies_instead_of_emulated_vehicles() -> None:
    plans = planned(asked(autopilots=["1*px4:b", "2*arducopter:a --model quad"]))
    assert [plan.seed for plan in plans] == [7, 8]
    plan = plans[0]
    assert list(plan.systems) == [1, 2, 3]
    assert [plan.flavour_of(system) for system in plan.systems] == ["px4", "ardupilot", "ardupilot"]
    assert plan.autopilots[1] == Program("ardupilot", "a", ("--model", "quad"))
    assert plan.name == "real-mixed"
    assert CertifiedPlan(autopilots=autopilots(["2*px4:b"])).name == "real-px4"
    assert plan.document(2, plan.random)["companion"]["certified"]["fleet"] == [1, 2, 3]


def test_real_firmware_has_no_key_of_a_trial() -> None:
    with pytest.raises(InputError, match="--signed"):
        planned(asked(autopilots=["2*px4:b"], signed=True))


@pytest.mark.parametrize(("tube", "sigma"), [(1.0, 0.02), (1.8, 0.35), (3.0, 0.5)])
def test_vehicles_start_and_arrive_further_apart_than_their_plans_have_to_be(tube, sigma) -> None:
    plan = CertifiedPlan(tube=tube, position_sigma=sigma)
    config = CompanionConfig.model_validate(plan.document(1, plan.random)["companion"])
    assert plan.distance == between(config.certified, config.field, config.limits)
    assert plan.spacing >= max(SPACING, plan.distance + 1.0)
    for turn in range(2):
        easts = sorted(plan.goal(system, turn)[0] for system in plan.systems)
        assert min(b - a for a, b in pairwise(easts)) == pytest.approx(plan.spacing)
    assert plan.start(2)[0] - plan.start(1)[0] == plan.spacing
    assert config.limits.box_max[0] > plan.start(5)[0]


def test_every_combination_of_options_gives_one_plan_for_each_flight() -> None:
    assert planned(asked(kind="px4", flights=1)) == [
        CertifiedPlan("px4", 5, 7, 0.1, victims=(), tube=1.5, position_sigma=0.3)
    ]
