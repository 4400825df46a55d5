"""What a trial is: the story that suits what flies, and what does not go together."""

from __future__ import annotations

import pytest

from outrider.errors import InputError
from trials.__main__ import planned
from trials.plan import MISHAPS, SORTIE, Plan

FIVE = ["arducopter:a"]


def test_the_emulation_goes_through_mishaps_quickly_and_a_sortie_at_the_speed_of_the_wall() -> None:
    assert planned(None, None, None, [], None) == Plan("ardupilot", 10.0, MISHAPS)
    assert planned(SORTIE, "px4", None, [], None) == Plan("px4", 1.0, SORTIE)
    assert planned(SORTIE, None, 5.0, [], None).speed == 5.0


def test_real_firmware_flies_a_sortie_unless_mishaps_are_asked_for() -> None:
    assert (planned(None, None, None, FIVE, None).story, planned(None, None, 1.0, FIVE, None).speed) == (
        SORTIE,
        1.0,
    )
    assert planned(MISHAPS, None, None, FIVE, None).story == MISHAPS


def test_companions_of_real_firmware_have_the_shipped_rates_and_find_out_about_the_clock() -> None:
    real = planned(None, None, None, ["2*arducopter:a", "1*px4:b"], "48,9,500")
    for flavour in ("ardupilot", "px4"):
        settings = real.settings(flavour)
        assert settings["companion"]["rates"] == {"replan_us": 20_000, "setpoint_us": 20_000}
        assert settings.get("clock", "auto") == "auto"
        assert settings["origin"] == {"latitude": 48.0, "longitude": 9.0, "altitude": 500.0}
    assert Plan("px4", 1.0).settings("px4")["clock"] == "autopilot"


def test_each_vehicle_has_the_file_of_its_firmware(tmp_path) -> None:
    plan = planned(None, None, None, ["2*arducopter:a", "1*px4:b"], None)
    assert [plan.flavour_of(system) for system in plan.systems] == ["ardupilot", "ardupilot", "px4"]
    paths = plan.write(tmp_path)
    assert set(paths) == {"ardupilot", "px4"}
    assert all(path.exists() for path in paths.values())


@pytest.mark.parametrize(
    ("asked", "why"),
    [
        ((None, "px4", None, FIVE, None), "--flavour is of emulated vehicles"),
        ((None, None, 5.0, FIVE, None), "--speed 5: real firmware is flown at 1"),
        ((None, None, 50.0, [], None), "--speed 50: allowed is 0.2 to 20"),
        ((MISHAPS, None, None, ["3*px4:b"], None), "happens to vehicles up to 4"),
        ((None, None, None, [], "48,9"), "allowed is LATITUDE,LONGITUDE,ALTITUDE"),
        ((None, None, None, [], "48,9,90000"), "allowed is LATITUDE,LONGITUDE,ALTITUDE"),
    ],
)
def test_what_does_not_go_together_is_said(asked, why: str) -> None:
    with pytest.raises(InputError, match=why):
        planned(*asked)
