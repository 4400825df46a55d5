"""docs/fly.md says what the command and its file have, all of it and nothing else."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import yaml
from typer.main import get_command

from companion.config import CompanionConfig
from companion.values.phase import Phase
from mavlink_bridge.links.endpoints import parse_endpoint
from outrider.__main__ import app
from outrider.onboard.link_budget import FLEET, SHARE, room, said, said_by_target
from outrider.onboard.orders import WORDS
from outrider.resources import find
from outrider.scenarios.fly_config import RADIOS, FlyConfig
from outrider.yaml_files.yaml_file import load

DOCS = Path(__file__).parents[2] / "docs"
TEXT = (DOCS / "fly.md").read_text(encoding="utf-8")
PAGES = [
    DOCS / f"{name}.md" for name in ("fly", "raspberry-pi-px4", "raspberry-pi-ardupilot", "mavlink-router")
]
OF_OTHERS = {
    "--count",
    "--first-id",
    "--port-base",
    "--to",
    "--origin",
    "--sensors",
    "--response",
    "--flavour",
}
OF_REPLAY = {"--certify"}
OF_SYSTEM = {"--home-dir", "--shell", "--now"}


def options(command: str) -> set[str]:
    parameters = get_command(app).commands[command].params  # type: ignore[attr-defined]
    return {option for parameter in parameters for option in parameter.opts}


def test_every_option_is_documented_and_every_documented_one_exists() -> None:
    assert options("sitl") >= OF_OTHERS
    assert options("replay") >= OF_REPLAY
    found = set(re.findall(r"(?<![-\w])--[a-z][a-z-]*", TEXT))
    assert found - OF_OTHERS - OF_REPLAY - OF_SYSTEM == options("fly")
    assert options("fly") <= set(re.findall(r"^\| `(--[a-z-]+)", TEXT, re.MULTILINE))


def test_every_key_of_the_file_is_documented() -> None:
    (block,) = re.findall(r"```yaml\n(.*?)```", TEXT, re.DOTALL)
    assert set(yaml.safe_load(block.replace("{…}", "{}"))) == set(FlyConfig.model_fields)
    FlyConfig.model_validate(yaml.safe_load(block.replace("{…}", "{}")))


def test_every_phase_and_order_is_documented() -> None:
    assert [phase.value for phase in Phase if phase.value not in TEXT] == []
    assert [word for word in WORDS if f"`{word}`" not in TEXT] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_what_the_pages_call_can_be_called(page: Path) -> None:
    lines = re.findall(r"^(?:/opt/outrider/bin/)?outrider (\w+) ([^#\n]*)", page.read_text(), re.MULTILINE)
    for name, rest in lines:
        assert set(re.findall(r"(?<![-\w])--[a-z-]+", rest)) <= options(name)
        for endpoint in re.findall(r"--(?:autopilot|swarm|target|ground) (\S+)", rest):
            if endpoint != "…":
                parse_endpoint(endpoint)
        for shipped in re.findall(r"--config (ardupilot|px4)\b", rest):
            load(find("companions", shipped), FlyConfig)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_what_the_pages_lead_to_is_there(page: Path) -> None:
    for link, anchor in re.findall(r"\]\(([\w-]+\.md)?(#[\w-]+)?\)", page.read_text(encoding="utf-8")):
        other = DOCS / link if link else page
        titles = re.findall(r"^#+ (.*)$", other.read_text(encoding="utf-8"), re.MULTILINE)
        anchors = {re.sub(r"[^\w -]", "", title).lower().replace(" ", "-") for title in titles}
        assert not anchor or anchor[1:] in anchors


def test_the_figures_of_the_links_are_those_of_the_program() -> None:
    """The table of bytes a second."""
    rows = []
    for config in (shipped(None), shipped(57600)):
        for signed in (False, True):
            one = said(config, signed)
            rows.append((round(one), round(FLEET * one + said_by_target(signed))))
    spaced = [(f"{one}", f"{all_:_}".replace("_", " ") if all_ > 9999 else f"{all_}") for one, all_ in rows]
    for one, all_ in spaced:
        assert f"| {one} | {all_}" in TEXT
    assert f"{rows[2][1]}: {rows[2][1] / 57.6:.0f} % of 57 600 baud" in TEXT
    assert f"{rows[3][1]}: {rows[3][1] / 57.6:.0f} %" in TEXT
    assert f"{100 * SHARE:.0f} % of that" in TEXT
    assert rows[3][1] <= room(57600)


def shipped(radio: int | None) -> CompanionConfig:
    assert radio is None or radio in RADIOS
    return load(find("companions", "px4"), FlyConfig).model_copy(update={"radio": radio}).settings
