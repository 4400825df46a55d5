"""The README on a package index: with the owner's addresses nothing in it is relative."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[2]
IMAGES, PAGES = "https://raw.example/v{version}/{path}", "https://pages.example/{version}/{path}"


@pytest.fixture(scope="module")
def hook() -> ModuleType:
    spec = spec_from_file_location("readme_hook", ROOT / "tools" / "readme_hook.py")
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_with_addresses_no_image_and_no_page_is_relative(hook: ModuleType) -> None:
    text = (ROOT / "README.md").read_text()
    made = hook.absolute(text, IMAGES, PAGES, "1.2.3")
    addresses = re.findall(r"\]\(([^)]+)\)", made)
    assert all(re.match(r"https?://|#", one) for one in addresses)
    # What they point at is there.
    ours = [
        one.partition("/v1.2.3/")[2] or one.partition("/1.2.3/")[2] for one in addresses if ".example/" in one
    ]
    assert ours
    assert all((ROOT / path.partition("#")[0]).exists() for path in ours)
    assert "https://raw.example/v1.2.3/docs/pictures/walk.gif" in made
    assert hook.absolute(text, "", "", "1.2.3") == text


def test_the_package_has_the_readme() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "hatchling", "metadata"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    readme = json.loads(done.stdout)["readme"]
    assert readme["content-type"] == "text/markdown"
    assert readme["text"].startswith("# ")
    assert "](docs/pictures/walk.gif)" in readme["text"]
