"""docs/sitl.md says what the command has, all of it and nothing else."""

from __future__ import annotations

import re
from pathlib import Path

from typer.main import get_command

from outrider.__main__ import app

TEXT = (Path(__file__).parents[2] / "docs" / "sitl.md").read_text(encoding="utf-8")
OF_OTHERS = {"--master"}


def test_every_option_is_documented_and_every_documented_one_exists() -> None:
    command = get_command(app).commands["sitl"]  # type: ignore[attr-defined]
    options = {option for parameter in command.params for option in parameter.opts}
    assert set(re.findall(r"--[a-z][a-z-]*", TEXT)) - OF_OTHERS == options
