"""What docs/flying-scenarios.md shows can be done: its pieces of a scenario are some."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
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


def test_its_own_scenario_plans_for_the_separation_that_it_is_judged_by() -> None:
    (block,) = [block for block in re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL) if "name: my" in block]
    found = read(block.encode(), "my.yaml", Scenario)
    assert found.companion.avoidance == "certified"
    assert found.companion.field.d_min == found.d_min


def test_its_own_surface_is_a_ring_of_the_stated_size_and_heights() -> None:
    (program,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    (project,) = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    settings = tomllib.loads(project)
    (module, name) = settings["project"]["entry-points"]["outrider.surfaces"]["saddle"].split(":")
    assert settings["tool"]["setuptools"]["py-modules"] == [module]
    made: dict[str, Any] = {}
    exec(compile(program, "saddle.py", "exec"), made)
    u, v = np.linspace(0.0, 1.0, 9), np.zeros(9)
    points = made[name](u, v, size=5.0)
    np.testing.assert_allclose(np.hypot(points[:, 0], points[:, 1]), 5.0)
    assert (points[:, 2].min(), points[:, 2].max()) == pytest.approx((5.0, 7.0))


def test_its_surfaces_are_some() -> None:
    found = shown("scenario-1", 1)
    assert found.companion.surface_of(12).height == 8.0
    assert found.size == found.vehicles + 2
    for other in re.findall(r"(\{kind: (?:sphere|cylinder|ellipsoid), (?:radius|semi).*?\})", PAGE):
        CompanionConfig.model_validate({"surface": yaml.safe_load(other)})


def test_what_tells_of_the_target_and_of_obstacles_can_be_told() -> None:
    found = shown("scenario-1", 2).companion
    assert found.target_source.kind == "follow_target"
    assert found.proximity is not None
    assert found.traffic is not None
    assert found.ground_messages.texts


def test_its_rough_world_is_one() -> None:
    found = shown("antipodal-8", 3)
    assert found.faults
    assert found.weather.wind == (6.0, 0.0, 0.0)


def test_its_way_can_be_switched_on() -> None:
    blocks = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
    (number,) = [number for number, block in enumerate(blocks) if "  way:" in block]
    assert shown("scenario-1", number).companion.way is not None
