"""Commands that README and docs show: all are understood, and those that end by themselves are run."""

from __future__ import annotations

import re
import shutil
from collections.abc import Sequence
from pathlib import Path

import pytest
from typer.main import get_command

from outrider.__main__ import app
from outrider.scenarios.options import Options
from outrider.simulation.preparation import prepare
from tests.house.commands import PAGES, ROOT, Shown, commands, programs
from tests.outrider.said import Run

COMMANDS = commands()
_AT_ONCE = ("list", "new", "report", "export", "key", "replay", "doctor")
"""Commands that end by themselves, and soon, if they do not listen to a link."""
_LIVE = ("udp", "tcp:", "mcast", "/dev/", "--to", "serial")
_OPTIONS = (
    "method",
    "avoidance",
    "planar",
    "vehicles",
    "loss",
    "delay_ms",
    "sensors",
    "replan_hz",
    "wind",
    "physics",
    "flavour",
    "response",
)


def test_there_are_some_of_every_kind() -> None:
    assert len(COMMANDS) > 40
    assert {shown.words[0] for shown in COMMANDS} >= {
        "swarm",
        "sitl",
        "fly",
        "replay",
        "sweep",
        "list",
        "new",
    }
    assert len({page for page, _ in programs()}) >= 2


@pytest.mark.parametrize("shown", COMMANDS, ids=str)
def test_a_shown_command_is_understood(shown: Shown) -> None:
    """Its name, options and values are ones that the command line takes."""
    group = get_command(app)
    name, *rest = shown.words
    command = group.commands[name]  # type: ignore[attr-defined]
    with command.make_context(name, list(rest), parent=group.make_context("outrider", [name])) as context:
        if name == "swarm" and not context.params["scenario"].startswith("my"):
            values = {key: context.params[key] for key in _OPTIONS}
            assert prepare(context.params["scenario"], Options(**values)).scenario


def _runnable(words: Sequence[str]) -> bool:
    live = any(mark in word for word in words for mark in _LIVE)
    return words[0] in _AT_ONCE and not live


@pytest.mark.slow
def test_commands_that_end_by_themselves_run_as_written(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the order of the pages, from a folder that holds what a fresh clone holds."""
    (tmp_path / "config").symlink_to(ROOT / "config")
    assert run("swarm", "antipodal-8", "--avoidance", "certified", "--out", "runs/sure").status == 0
    told: dict[str, str] = {}
    files = {"my.yaml", "fleet.key"}
    for shown in dict.fromkeys(COMMANDS):
        if not _runnable(shown.words) or any(word.isupper() for word in shown.words):
            continue
        if any("/" in word and not Path(word.split(":", 1)[-1]).exists() for word in shown.words[1:]):
            told[str(shown)] = "its file is not shipped"
            continue
        for name in files:
            Path(name).unlink(missing_ok=True)
        ended = run(*shown.words)
        assert ended.status in (0, 1), f"{shown}: {ended.err}"
        told[str(shown)] = "run"
        for made in ("csv", "parquet", "ulog", "flight.mcap"):
            shutil.rmtree(tmp_path / "runs" / "sure" / made, ignore_errors=True)
            (tmp_path / "runs" / "sure" / made).unlink(missing_ok=True)
    done = [line for line, how in told.items() if how == "run"]
    assert len(done) >= 8, told


@pytest.mark.slow
@pytest.mark.parametrize(("page", "text"), programs(), ids=lambda value: str(value)[:20])
def test_a_shown_program_runs(page: str, text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    exec(compile(text, page, "exec"), {})


def test_every_page_is_in_the_index() -> None:
    index = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    site = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    for page in PAGES:
        if page.parent == ROOT / "docs" and page.name != "index.md":
            assert f"]({page.name}" in index, page.name
            assert re.search(rf"[ \[]{page.name}\b", site), page.name


def test_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 125
