"""A fleet's companions are told how wrong its sensors are."""

from __future__ import annotations

import pytest

from outrider.simulation.fleet import Fleet
from sitl.estimation.profiles import PROFILES, ProfileName
from tests.outrider.shipped import FIREFLY, LOGS, scenario


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("said", [0.0, 0.3, 2.0])
def test_the_field_knows_the_larger_of_what_the_profile_and_the_file_say(
    profile: ProfileName, said: float
) -> None:
    of = scenario("antipodal-8", sensors=profile, companion={"field": {"position_sigma": said}})
    told = Fleet(of, FIREFLY, 1, LOGS).companion_config
    assert told.field.position_sigma == max(said, PROFILES[profile].worst_axis)
    assert told.model_copy(update={"field": of.companion.field}) == of.companion


def test_the_margins_of_the_profiles() -> None:
    """What the documents say: m between two vehicles."""
    margins = {
        name: Fleet(scenario("antipodal-8", sensors=name), FIREFLY, 1, LOGS).companion_config.field
        for name in PROFILES
    }
    assert {name: round(field.margin(2), 2) for name, field in margins.items()} == {
        "truth": 0.0,
        "rtk": 0.08,
        "gnss": 1.70,
        "sih": 1.13,
    }
