"""Build hook: the README of the package, with absolute addresses, so that its images show on a package index.

``[tool.hatch.metadata.hooks.custom]`` in pyproject.toml has ``images`` and ``pages``: addresses with
``{path}`` and ``{version}``. They are the owner's; while they are empty the README stays as it is, and an
index shows no images.
"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

_LINK = re.compile(r"(!?)\[([^\]]*)\]\((?![a-z]+:|#)([^)\s]+)\)")


def absolute(text: str, images: str, pages: str, version: str) -> str:
    """Return the Markdown ``text`` with absolute addresses for images and pages, or without a change."""

    def address(found: re.Match[str]) -> str:
        mark, words, path = found.groups()
        of = images if mark else pages
        return f"{mark}[{words}]({of.format(path=path, version=version)})" if of else found[0]

    return _LINK.sub(address, text)


class ReadmeHook(MetadataHookInterface):
    """Hook of hatchling that sets the README."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Set ``readme`` of the package's ``metadata``."""
        root = Path(self.root)
        version = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
        text = (root / "README.md").read_text(encoding="utf-8")
        images, pages = (str(self.config.get(name, "")) for name in ("images", "pages"))
        metadata["readme"] = {
            "content-type": "text/markdown",
            "text": absolute(text, images, pages, version),
        }
