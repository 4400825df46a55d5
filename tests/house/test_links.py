"""Links of README and the documents, and pages that the code names, lead to files and headings there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.house.commands import ROOT

PAGES = sorted(
    path
    for folder in (".", "docs", "docs/gallery", "examples", "config/logs")
    for path in (ROOT / folder).glob("*.md")
)
_LINK = re.compile(r"\]\(([^)\s]+)\)")
_CODE = [
    path
    for folder in ("companion", "config", "examples", "mavlink_bridge", "sitl", "tests", "tools")
    for path in sorted((ROOT / folder).rglob("*"))
    if path.suffix in {".html", ".js", ".json", ".py", ".pyi", ".sh", ".toml", ".yaml"}
]
_NAMED = re.compile(r"\bdocs/([\w/-]+\.md)(?:#([\w-]+))?")


def anchors(page: Path) -> set[str]:
    """The anchors of a page, as GitHub makes them."""
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    found = set(re.findall(r'<a id="([^"]+)"', text))
    for heading in re.findall(r"^#+ (.*)$", text, re.MULTILINE):
        words = re.sub(r"[^\w\- ]", "", re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).lower())
        found.add(words.strip().replace(" ", "-"))
    return found


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page: Path) -> None:
    for link in _LINK.findall(page.read_text(encoding="utf-8")):
        if re.match(r"[a-z]+:", link):
            continue
        path, _, anchor = link.partition("#")
        target = page if not path else (page.parent / path).resolve()
        assert target.exists(), f"{page.name}: {link}"
        if anchor and target.suffix == ".md":
            assert anchor in anchors(target), f"{page.name}: {link}"


def test_pages_that_the_code_names_are_there() -> None:
    named = {
        (*match, str(path.relative_to(ROOT)))
        for path in _CODE
        for match in _NAMED.findall(path.read_text(encoding="utf-8", errors="replace"))
    }
    assert len(named) > 10
    for page, anchor, path in sorted(named):
        assert (ROOT / "docs" / page).exists(), f"{path}: {page}"
        if anchor:
            assert anchor in anchors(ROOT / "docs" / page), f"{path}: {page}#{anchor}"


def test_every_picture_is_shown_by_a_page() -> None:
    shown = {
        (page.parent / link).resolve()
        for page in PAGES
        for link in _LINK.findall(page.read_text(encoding="utf-8"))
    }
    pictures = {
        path for folder in ("pictures", "gallery") for path in (ROOT / "docs" / folder).glob("*.[pgjs]*")
    }
    assert len(pictures) > 10
    assert pictures <= shown
