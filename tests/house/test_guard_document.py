"""docs/guard.md knows every limit that there is."""

from __future__ import annotations

from pathlib import Path

from companion.config import GuardConfig

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
        "`tube` (1 m)": guard.tube == 1.0,
    }
    assert all(words in TEXT and true for words, true in said.items())
