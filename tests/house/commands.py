"""Commands and programs that README and the pages of docs show."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
PAGES = (ROOT / "README.md", ROOT / "examples" / "README.md", *sorted((ROOT / "docs").glob("*.md")))
_BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)


class Shown(NamedTuple):
    """A command of ``outrider`` as words, and the page that shows it."""

    page: str
    words: tuple[str, ...]

    def __str__(self) -> str:
        return f"{self.page}: outrider {' '.join(self.words)}"


def commands() -> list[Shown]:
    """All commands of ``outrider`` in blocks without a language."""
    found = []
    for page in PAGES:
        for language, block in _BLOCK.findall(page.read_text(encoding="utf-8")):
            if language not in ("", "sh", "bash"):
                continue
            for line in block.replace("\\\n", " ").splitlines():
                match = re.match(r"\s*(?:\$ )?(?:\.venv/bin/)?outrider (\w.*)", line)
                if match and "…" not in match[1].split(" #")[0]:
                    name = str(page.relative_to(ROOT))
                    found.append(Shown(name, tuple(shlex.split(match[1], comments=True))))
    return found


def programs() -> list[tuple[str, str]]:
    """Page and text of every block of Python that imports outrider."""
    return [
        (str(page.relative_to(ROOT)), block)
        for page in PAGES
        for language, block in _BLOCK.findall(page.read_text(encoding="utf-8"))
        if language == "python" and re.search(r"^(?:from|import) outrider", block, re.MULTILINE)
    ]
