"""What `outrider fly` leaves is no flight of a scenario: the commands that need one say what its log is good
for, and it is."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
import yaml

from outrider.resources import config_root, find
from outrider.scenarios.fly_config import FlyConfig
from outrider.yaml_files.yaml_file import load
from tests.outrider.said import Run

LOG = config_root() / "logs" / "escort-target.tlog"


def leave(directory: Path, name: str) -> Path:
    """As `outrider fly` does; the log."""
    directory.mkdir()
    config = load(find("companions", name), FlyConfig).model_copy(update={"system": 3})
    document = yaml.safe_dump(config.model_dump(mode="json"))
    (directory / "configuration.yaml").write_text(document, encoding="utf-8")
    return Path(shutil.copy(LOG, directory / "vehicle-3.tlog"))


@pytest.mark.parametrize("name", ["px4", "ardupilot"])
@pytest.mark.parametrize(
    ("command", "advice"),
    [
        (("export", "--format", "csv"), "{}"),
        (("replay",), "{} with --own ID, or --list"),
        (("view",), "tlog:{}"),
        (("replay", "--certify"), None),
    ],
    ids=str,
)
def test_one_line_says_what_its_log_is_good_for(
    run: Run, tmp_path: Path, name: str, command: tuple[str, ...], advice: str | None
) -> None:
    log = leave(tmp_path / "left", name)
    ended = run(command[0], str(log.parent), *command[1:])
    assert (ended.status, ended.out, ended.err.count("\n")) == (2, "", 1)
    assert "what outrider fly left is no flight of a scenario" in ended.err
    if advice is not None:
        assert ended.err.endswith(f"allowed: {advice.format(log)}\n")


def test_the_advice_can_be_followed(run: Run, tmp_path: Path) -> None:
    log = str(leave(tmp_path / "left", "px4"))
    assert run("replay", log, "--list").status == 0
    assert run("export", log, "--format", "csv", "--out", "tables").status == 0
    assert run("view", f"tlog:{log}", "--seconds", "0.1").status == 0


def test_what_is_neither_says_what_is_wrong(run: Run, tmp_path: Path) -> None:
    (tmp_path / "configuration.yaml").write_text("seed: 1\n", encoding="utf-8")
    ended = run("replay", str(tmp_path))
    assert ended.status == 2
    assert "scenario" in ended.err
