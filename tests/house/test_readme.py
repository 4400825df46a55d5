"""What README shows can be done: its piece of a scenario is one, its commands exist."""

from __future__ import annotations

import re
from pathlib import Path

import yaml
from typer.main import get_command

from outrider.__main__ import app
from outrider.resources import find
from outrider.scenario import Scenario
from outrider.yaml_file import load, read

README = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")


def test_its_scenario_is_one() -> None:
    (block,) = re.findall(r"```yaml\n(.*?)```", README, re.DOTALL)
    base = load(find("scenarios", "antipodal-8"), Scenario).model_dump(mode="json")
    shown = yaml.safe_load(block)
    text = yaml.safe_dump({**base, **shown}, allow_unicode=True)
    found = read(text.encode(), "README.md", Scenario)
    assert found.faults
    assert found.weather.wind == (6.0, 0.0, 0.0)


def test_its_commands_and_options_exist() -> None:
    commands = get_command(app).commands  # type: ignore[attr-defined]
    lines = re.findall(r"outrider (\w+) ([^`\n#]*)", README)
    assert len(lines) >= 5
    for name, rest in lines:
        if name in commands:
            options = {option for parameter in commands[name].params for option in parameter.opts}
            assert set(re.findall(r"--[a-z-]+", rest)) <= options
    assert {name for name, _ in lines} & set(commands) >= {"swarm", "sweep"}
