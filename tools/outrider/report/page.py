"""HTML page: a template, styles and scripts from ``static/``, and the parts made from a run.

The page loads no other resources. Its content security policy makes the browser block requests, and permits
only the style and the script with the given hashes, so that text from a log is never executed.
"""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Mapping
from html import escape
from importlib.resources import files

from outrider.palette import css
from outrider.report.headline import Headline

MARK = '<meta name="generator" content="outrider report">'
"""HTML tag by which ``outrider report`` recognises its own pages."""
STYLES = ("page.css", "charts.css", "print.css")
SCRIPTS = (
    "data.js",
    "cursor.js",
    "camera.js",
    "glyphs.js",
    "blocks.js",
    "order.js",
    "extent.js",
    "scene.js",
    "vehicles.js",
    "sight.js",
    "view.js",
    "axes.js",
    "charts.js",
    "histogram.js",
    "main.js",
)


def static(name: str) -> str:
    """Return the text of the file ``name`` in ``static/``."""
    return (files("outrider.report") / "static" / name).read_text(encoding="utf-8")


def stylesheet() -> str:
    """Return the style sheet, with the colours of ``palette`` as its variables."""
    text = "\n".join(static(name) for name in STYLES)
    return text.replace("{{light}}", css(dark=False)).replace("{{dark}}", css(dark=True))


def page(title: str, headline: Headline, parts: Mapping[str, str], document: str | None) -> str:
    """Return the whole page.

    ``parts``: HTML by the names of the placeholders in the template. ``document``: the replay as JSON, or
    None to hide the replay and the charts.
    """
    style = stylesheet()
    script = '"use strict";\n(() => {\n' + "\n".join(static(name) for name in SCRIPTS) + "\n})();"
    values = {
        "mark": MARK,
        "policy": policy(style, script),
        "title": escape(title),
        "verdict": headline.verdict,
        "outcome": escape(headline.outcome),
        "style": style,
        "script": script,
        "document": "null" if document is None else document,
        "hidden": "" if document is not None else "hidden",
        **parts,
    }
    # In one pass: inserted text is not searched again.
    return re.sub(r"\{\{(\w+)\}\}", lambda found: values[found[1]], static("page.html"))


def policy(style: str, script: str) -> str:
    """Return the content security policy: no requests, only this style and this script."""
    return (
        f"default-src 'none'; style-src '{_hash(style)}'; script-src '{_hash(script)}'; "
        "base-uri 'none'; form-action 'none'"
    )


def _hash(text: str) -> str:
    return f"sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode('ascii')}"
