"""The generated pages are up to date, describe everything, and their links lead somewhere."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from pydantic import BaseModel

import outrider
from companion.config import CompanionConfig
from outrider import sim
from outrider.scenarios.scenario import Scenario
from reference.__main__ import PAGES
from reference.settings import undescribed
from sitl.vehicle.config import VehicleConfig

DOCS = Path(__file__).parents[2] / "docs"


@pytest.mark.parametrize("name", PAGES)
def test_a_page_is_up_to_date(name: str) -> None:
    assert (DOCS / name).read_text(encoding="utf-8") == PAGES[name](), "make docs writes it anew"


@pytest.mark.parametrize("name", PAGES)
def test_its_links_lead_to_its_headings(name: str) -> None:
    text = (DOCS / name).read_text(encoding="utf-8")
    anchors = {
        heading.strip().lower().replace(" ", "-") for heading in re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    }
    for target in re.findall(r"\]\(#([^)]*)\)", text):
        assert target in anchors


@pytest.mark.parametrize("model", [CompanionConfig, Scenario, VehicleConfig])
def test_every_key_is_described(model: type[BaseModel]) -> None:
    assert undescribed(model) == []


def test_every_public_name_is_on_the_page() -> None:
    text = (DOCS / "api.md").read_text(encoding="utf-8")
    for name in (*outrider.__all__, *sim.__all__):
        assert re.search(rf"^### {name}$|`outrider.{name}`", text, re.MULTILINE), name
    assert "None\n" not in re.findall(r"^[^`\n]*$", text, re.MULTILINE)
