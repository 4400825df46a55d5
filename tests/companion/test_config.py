"""Settings that contradict each other are refused at load, with the reason; what is loaded stays as it is."""

from __future__ import annotations

import re

import pytest
from pydantic import ValidationError

from companion.config import CompanionConfig
from companion.config.planning import LimitsConfig

WRONG = {
    "an unknown key": ({"feild": {"gain": 1.0}}, "feild"),
    "an unknown key below": ({"field": {"d_max": 1.0}}, "d_max"),
    "a negative gain": ({"field": {"gain": -1.0}}, "gain"),
    "NaN": ({"field": {"gain": float("nan")}}, "gain"),
    "infinity": ({"surface": {"radius": float("inf")}}, "radius"),
    "d_safe below d_min": ({"field": {"d_min": 2.0, "d_safe": 1.5}}, "d_safe"),
    "a box without inside": ({"limits": {"box_min": (0.0, 0.0, 5.0), "box_max": (1.0, 1.0, 5.0)}}, "box_min"),
    "less than u_max": ({"limits": {"u_max": (3.0, 2.0, 2.0), "a_total": 2.5}}, "a_total"),
    "less than -u_min": ({"limits": {"u_min": (-3.0, -2.0, -2.0), "a_total": 2.5}}, "a_total"),
    "a least velocity above zero": ({"limits": {"v_min": (-1.0, -1.0, 0.5)}}, "v_min"),
    "a least input within the rounding of plans": (
        {"limits": {"u_min": -0.005}},
        "less than or equal to -0.1",
    ),
    "a least velocity of nearly zero": ({"limits": {"v_min": -0.05}}, "less than or equal to -0.1"),
    "a least input of zero": ({"limits": {"u_min": 0.0}}, "u_min"),
    "a force that the least input cancels": (
        {"limits": {"u_min": -6.5}, "methods": ("tangential",)},
        "force_max",
    ),
    "a band that a step skips": ({"tangential": {"d_band": 0.4}}, "d_band"),
    "a tangential force that is cancelled": ({"tangential": {"force_max": 2.0}}, "force_max"),
    "full outside the band": ({"tangential": {"d_full": 4.0}}, "d_full"),
    "half a target": ({"target_d_min": 1.0}, "target_d_safe"),
    "a target's d_safe below its d_min": ({"target_d_min": 3.0, "target_d_safe": 1.0}, "target_d_safe"),
    "full outside the target's band": (
        {"target_d_min": 0.2, "target_d_safe": 0.3, "tangential": {"d_full": 1.5}},
        "d_full",
    ),
    "a period off the grid": ({"rates": {"replan_us": 10_001}}, "replan_us"),
    "a plan too long for the wire": ({"horizon": {"steps": 16}}, "steps"),
    "steps too long for the wire": ({"horizon": {"dt_us": 262_144}}, "dt_us"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_contradiction_is_refused_and_named(name):
    settings, word = WRONG[name]
    with pytest.raises(ValidationError) as refused:
        CompanionConfig.model_validate(settings)
    # What pydantic quotes of the input does not count.
    assert any(word in f"{fault['loc']} {fault['msg']}" for fault in refused.value.errors())


@pytest.mark.parametrize("beyond", [0.0, 0.5])
def test_a_band_that_is_full_only_outside_the_field_is_refused_by_name(beyond):
    """The message itself says it; the settings that pydantic quotes beside it do not count."""
    settings = {"field": {"d_safe": 1.5}, "tangential": {"d_full": 1.5 + beyond}}
    with pytest.raises(ValidationError) as refused:
        CompanionConfig.model_validate(settings)
    (fault,) = refused.value.errors()
    assert re.search(r"tangential\.d_full .* d_safe, here 1\.5 m", fault["msg"])
    settings["tangential"]["d_full"] = 1.49
    assert CompanionConfig.model_validate(settings).tangential.d_full == 1.49


def test_settings_are_frozen():
    config = CompanionConfig()
    with pytest.raises(ValidationError):
        config.planar = True
    with pytest.raises(ValidationError):
        config.field.gain = 1.0


def test_what_is_written_is_what_is_read():
    config = CompanionConfig.model_validate({"planar": True, "field": {"gain": 20.0}})
    assert CompanionConfig.model_validate(config.model_dump()) == config
    assert CompanionConfig.model_validate_json(config.model_dump_json()) == config


@pytest.mark.parametrize("bounds", ["u_max", "v_max", "j_max"])
def test_one_number_bounds_each_axis(bounds: str) -> None:
    one, three = (CompanionConfig.model_validate({"limits": {bounds: value}}) for value in (4.0, [4.0] * 3))
    assert one == three
    for wrong in (True, "4 m/s", 0.0, [4.0, 4.0], {"x": 4.0}):
        with pytest.raises(ValidationError):
            CompanionConfig.model_validate({"limits": {bounds: wrong}})


def test_least_values_are_those_of_the_other_direction_unless_stated() -> None:
    plain = LimitsConfig.model_validate({"u_max": [1.0, 2.0, 3.0], "v_max": 4.0})
    assert (plain.least_u, plain.least_v) == ((-1.0, -2.0, -3.0), (-4.0, -4.0, -4.0))
    assert plain.strongest == plain.weakest == plain.u_max
    stated = {"u_max": [2.0, 2.0, 6.0], "u_min": [-2.0, -3.0, -4.0], "v_max": 2.0, "v_min": -3.0}
    limits = LimitsConfig.model_validate(stated)
    assert (limits.least_u, limits.least_v) == ((-2.0, -3.0, -4.0), (-3.0, -3.0, -3.0))
    assert (limits.strongest, limits.weakest) == ((2.0, 3.0, 6.0), (2.0, 2.0, 4.0))
    assert limits.fastest == (3.0, 3.0, 3.0)


@pytest.mark.parametrize(("avoidance", "planar"), [("field", True), ("certified", False)])
def test_lanes_need_committed_plans_in_a_plane(avoidance: str, planar: bool) -> None:
    """Only there vehicles tell their goals, and only in a plane is it known where two cannot pass."""
    settings = {"avoidance": avoidance, "planar": planar, "way": {"lanes": 0.5}}
    with pytest.raises(ValueError, match=r"way\.lanes: allowed only with avoidance: certified"):
        CompanionConfig.model_validate(settings)
    CompanionConfig.model_validate({**settings, "avoidance": "certified", "planar": True})
