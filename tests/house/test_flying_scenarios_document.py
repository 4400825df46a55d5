"""What docs/flying-scenarios.md shows can be done: its pieces of a scenario are some."""

from __future__ import annotations

import re
from pathlib import Path

import yaml

from companion.config import CompanionConfig
from outrider.resources import find
from outrider.scenarios.scenario import Scenario
from outrider.yaml_files.yaml_file import load, read

PAGE = (Path(__file__).parents[2] / "docs" / "flying-scenarios.md").read_text(encoding="utf-8")


def shown(name: str, number: int) -> Scenario:
    """A shipped scenario with what a block of YAML shows."""
    block = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)[number]
    base = load(find("scenarios", name), Scenario).model_dump(mode="json")
    text = yaml.safe_dump({**base, **yaml.safe_load(block)}, allow_unicode=True)
    return read(text.encode(), "flying-scenarios.md", Scenario)


def test_its_surfaces_are_some() -> None:
    found = shown("scenario-1", 0)
    assert found.companion.surface_of(12).height == 8.0
    assert found.size == found.vehicles + 2
    for other in re.findall(r"(\{kind: (?:sphere|cylinder|ellipsoid), (?:radius|semi).*?\})", PAGE):
        CompanionConfig.model_validate({"surface": yaml.safe_load(other)})


def test_what_tells_of_the_target_and_of_obstacles_can_be_told() -> None:
    found = shown("scenario-1", 1).companion
    assert found.target_source.kind == "follow_target"
    assert found.proximity is not None
    assert found.traffic is not None
    assert found.ground_messages.texts


def test_its_rough_world_is_one() -> None:
    found = shown("antipodal-8", 2)
    assert found.faults
    assert found.weather.wind == (6.0, 0.0, 0.0)


def test_its_way_can_be_switched_on() -> None:
    blocks = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
    (number,) = [number for number, block in enumerate(blocks) if "  way:" in block]
    assert shown("scenario-1", number).companion.way is not None
