"""What ``outrider fly`` is asked for is refused before anything moves, with what is allowed."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from outrider.errors import InputError
from outrider.fly.request import Options, checked
from outrider.resources import find

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
