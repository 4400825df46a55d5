"""docs/guard.md knows every limit that there is."""

from __future__ import annotations

from pathlib import Path

import pytest

from companion.config.flight import GuardConfig
from outrider.resources import find
from outrider.scenarios.fly_config import FlyConfig
from outrider.yaml_files.yaml_file import load

TEXT = (Path(__file__).parents[2] / "docs" / "guard.md").read_text(encoding="utf-8")


def test_every_limit_is_in_the_document() -> None:
    assert [name for name in GuardConfig.model_fields if f"`{name}`" not in TEXT] == []


def test_defaults_in_the_document_are_those_of_the_settings() -> None:
    guard = GuardConfig()
    said = {
        "`own_stale_us` (0.5 s)": guard.own_stale_us == 500_000,
        "`own_lost_us` (5 s)": guard.own_lost_us == 5_000_000,
        "`target_stale_us` (3 s)": guard.target_stale_us == 3_000_000,
        "`neighbour_lost_us` (3 s)": guard.neighbour_lost_us == 3_000_000,
        "`unsolved_us` (5 s)": guard.unsolved_us == 5_000_000,
        "`battery_low` (20 %)": guard.battery_low == 0.2,
        "`battery_critical` (10 %)": guard.battery_critical == 0.1,
        "`late_us` (0.1 s)": guard.late_us == 100_000,
        "`tube` (1 m;": guard.tube == 1.0,
        "`hold_us` (0.5 s)": guard.hold_us == 500_000,
        "`plan_stale_us` (0.5 s)": guard.plan_stale_us == 500_000,
        "`flown_on_us` (0:": guard.flown_on_us == 0,
        "`cautious_speed` at most, beside the target's (null:": guard.cautious_speed is None,
        "`fence_height` (null:": guard.fence_radius is None and guard.fence_height is None,
        "`landing_speed` (0.3 m/s)": guard.landing_speed == 0.3,
        "`landing_clearance` (1 m)": guard.landing_clearance == 1.0,
        "`settle_us` (30 s)": guard.settle_us == 30_000_000,
        "`go_keeps_us` (30 s;": guard.go_keeps_us == 30_000_000,
        "`displaced` (5 m)": guard.displaced == 5.0,
    }
    assert [words for words, true in said.items() if not (words in TEXT and true)] == []


@pytest.mark.parametrize("name", ["px4", "ardupilot"])
def test_what_is_said_of_the_shipped_files_is_in_them(name: str) -> None:
    guard = load(find("companions", name), FlyConfig).companion.guard
    said = {
        "10 s in the shipped files": guard.go_keeps_us == 10_000_000,
        "**3 s in the shipped files**": guard.flown_on_us == 3_000_000,
        "**2 m/s in the shipped files**": guard.cautious_speed == 2.0,
        "**150 m and 40 m in the shipped files**": (guard.fence_radius, guard.fence_height) == (150.0, 40.0),
        "**2 m in the shipped files**": guard.tube == 2.0,
    }
    assert [words for words, true in said.items() if not (words in TEXT and true)] == []
