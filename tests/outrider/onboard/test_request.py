"""What ``outrider fly`` is asked for is refused before anything moves, with what is allowed."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from companion.config import CompanionConfig
from outrider.errors import InputError
from outrider.onboard.request import Options, checked
from outrider.resources import find
from outrider.scenarios.fleet_file import Measurement, settings_of, text_of
from outrider.scenarios.fly_config import FlyConfig

AUTOPILOT, SWARM = "udpin:127.0.0.1:14550", "mcast:,127.0.0.1"


@pytest.mark.parametrize("shipped", ["ardupilot", "px4"])
def test_no_two_vehicles_get_one_id_by_default(shipped: str) -> None:
    with pytest.raises(InputError, match=r"--system: is missing.*1…250"):
        checked(Options(AUTOPILOT, shipped, SWARM))
    assert checked(Options(AUTOPILOT, shipped, SWARM, system=7)).system == 7
    assert checked(Options("tlog:flight.tlog", shipped, dry_run=True)).system == 1


def test_a_neighbour_is_never_anyones_target(tmp_path: Path) -> None:
    document = yaml.safe_load(find("companions", "px4").read_text(encoding="utf-8"))
    document["companion"]["target_source"] = {"kind": "global_position", "anyone": True}
    own = tmp_path / "own.yaml"
    own.write_text(yaml.safe_dump(document), encoding="utf-8")
    with pytest.raises(InputError, match="every neighbour would be the target"):
        checked(Options(AUTOPILOT, str(own), SWARM, system=7))
    asked = checked(Options(AUTOPILOT, str(own), SWARM, "udpin:127.0.0.1:14600", system=7))
    assert asked.endpoints["target"] != asked.endpoints["swarm"]


def test_a_fleet_file_of_another_fleet_is_refused_before_anything_moves(tmp_path: Path) -> None:
    document = yaml.safe_load(find("companions", "px4").read_text(encoding="utf-8"))
    settings = CompanionConfig.model_validate({"certified": {"fleet": (1, 2)}})
    measured = Measurement(at="", seconds=5.0, configured=(), vehicles=(), links=())
    fleet = settings_of(settings, FlyConfig.model_validate(document).origin, measured)
    (tmp_path / "fleet.yaml").write_text(text_of(fleet), encoding="utf-8")
    own = tmp_path / "own.yaml"
    own.write_text(yaml.safe_dump({**document, "fleet": "fleet.yaml"}), encoding="utf-8")
    with pytest.raises(InputError, match=r"companion\.field\.position_sigma: is 0\.3, and 0\.0 in") as caught:
        checked(Options(AUTOPILOT, str(own), SWARM, system=7))
    assert "lacks the own system id 7" in str(caught.value)


@pytest.mark.parametrize("dry_run", [False, True])
@pytest.mark.parametrize(("period", "warned"), [(20_000, False), (50_000, False), (50_004, True)])
def test_plans_that_are_far_apart_are_warned_of(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], period: int, warned: bool, dry_run: bool
) -> None:
    document = yaml.safe_load(find("companions", "px4").read_text(encoding="utf-8"))
    document["companion"]["rates"]["replan_us"] = period
    own = tmp_path / "own.yaml"
    own.write_text(yaml.safe_dump(document), encoding="utf-8")
    checked(Options(AUTOPILOT, str(own), SWARM, system=7, dry_run=dry_run))
    said = [line for line in capsys.readouterr().err.splitlines() if "replan_us" in line]
    assert len(said) == warned
    assert all(f"{period} µs" in line and "at most 50000" in line for line in said)
