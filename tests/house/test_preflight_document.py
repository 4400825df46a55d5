"""docs/preflight.md says what the command has, all of it and nothing else."""

from __future__ import annotations

import re
from pathlib import Path

from typer.main import get_command

from companion.config import CompanionConfig
from outrider.__main__ import app
from outrider.scenarios.fleet_file import FleetFile

TEXT = (Path(__file__).parents[2] / "docs" / "preflight.md").read_text(encoding="utf-8")

OF_SWARM = {"--vehicles", "--avoidance", "--sensors", "--response", "--flavour"}


def test_every_option_is_documented_and_every_documented_one_exists() -> None:
    parameters = get_command(app).commands["preflight"].params  # type: ignore[attr-defined]
    options = {option for parameter in parameters for option in parameter.opts}
    assert set(re.findall(r"(?<![-\w])--[a-z][a-z-]*", TEXT)) - OF_SWARM == options


def test_every_key_of_the_fleet_file_is_documented() -> None:
    assert [name for name in FleetFile.model_fields if name not in TEXT] == []


def test_the_settings_that_a_fleet_file_replaces_exist() -> None:
    (line,) = re.findall(r"all its settings: (.*?)\n\n", TEXT, re.DOTALL)
    first, _, certified = line.partition("of `certified`:")
    names = re.findall(r"`([a-z_.]+)`", first)
    names += [f"certified.{name}" for name in re.findall(r"`([a-z_.]+)`", certified)]
    for name in names:
        if name == "origin":
            continue
        value: object = CompanionConfig()
        for part in name.split("."):
            assert hasattr(value, part), name
            value = getattr(value, part)
