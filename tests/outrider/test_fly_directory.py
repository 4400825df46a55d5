"""What `outrider fly` leaves is no flight of a scenario: the commands that need one name the log instead."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml
from said import Run

from outrider.aboard.fly_config import FlyConfig
from outrider.resources import find
from outrider.yaml_file import load


@pytest.mark.parametrize(
    "command",
    [("export", "--format", "csv"), ("replay",), ("replay", "--certify"), ("view",)],
    ids=" ".join,
)
@pytest.mark.parametrize("name", ["px4", "ardupilot"])
def test_its_log_is_named(run: Run, tmp_path: Path, name: str, command: tuple[str, ...]) -> None:
    document = (
        load(find("companions", name), FlyConfig).model_copy(update={"system": 3}).model_dump(mode="json")
    )
    (tmp_path / "configuration.yaml").write_text(yaml.safe_dump(document), encoding="utf-8")
    (tmp_path / "vehicle-3.tlog").write_bytes(b"")
    ended = run(command[0], str(tmp_path), *command[1:])
    assert ended.status == 2
    assert ended.err.count("\n") == 1
    assert ended.err.endswith(f"allowed: {tmp_path / 'vehicle-3.tlog'}\n")


def test_what_is_neither_says_what_is_wrong(run: Run, tmp_path: Path) -> None:
    (tmp_path / "configuration.yaml").write_text("seed: 1\n", encoding="utf-8")
    ended = run("replay", str(tmp_path))
    assert ended.status == 2
    assert "scenario" in ended.err
