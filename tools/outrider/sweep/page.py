"""Summary of a sweep as one HTML page with the style of a run's report.

The page works offline, has no script and contains the picture. All external text is escaped.
"""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Sequence
from html import escape
from pathlib import Path

from outrider.report.page import stylesheet
from outrider.runs import whole_file
from outrider.sweep.report import METHOD, CellReport, Named, exit_status
from outrider.sweep.table import rows

PAGE = "summary.html"
_STYLE = "img { max-width: 100%; background: #fff; } td.number { text-align: right; }"


def write(path: Path, name: str, cells: Sequence[CellReport], picture: Path) -> None:
    """Write the page; ``picture`` is an existing PNG."""
    style = f"{stylesheet()}\n{_STYLE}"
    digest = base64.b64encode(hashlib.sha256(style.encode()).digest()).decode("ascii")
    policy = f"default-src 'none'; img-src data:; style-src 'sha256-{digest}'; "
    policy += "base-uri 'none'; form-action 'none'"
    image = base64.b64encode(picture.read_bytes()).decode("ascii")
    verdict = "bad" if exit_status(cells) else "good"
    whole_file.write(
        path,
        f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>sweep {escape(name)} · outrider</title>
<style>{style}</style>
</head>
<body>
<header><p class="what">sweep {escape(name)}</p><h1 class="{verdict}">{escape(_outcome(cells))}</h1></header>
<main>
<section><div class="scroll">{_table(cells)}</div><p class="note">{escape(METHOD)}</p></section>
<section><img alt="times to converge and least separations" src="data:image/png;base64,{image}"></section>
<section><h2>Runs to look at</h2>{_named(cells)}</section>
</main>
</body>
</html>
""",
    )


def _outcome(cells: Sequence[CellReport]) -> str:
    words = [f"{sum(cell.runs for cell in cells)} runs"]
    for attribute, said in (
        ("violations", "with a violation"),
        ("stuck", "stuck"),
        ("failed", "failed"),
        ("faults", "at fault"),
        ("lost", "lost"),
    ):
        count = sum(getattr(cell, attribute) for cell in cells)
        words += [f"{count} {said}"] if count else []
    return ", ".join(words if len(words) > 1 else [*words, "all ended well"])


def _table(cells: Sequence[CellReport]) -> str:
    """Return a table with a row for each cell, because there may be many cells."""
    found = rows(cells)
    head = "".join(f"<th scope=col>{escape(words)}</th>" for words, _ in found)
    body = "".join(
        f"<tr><th scope=row>{escape(cell.label)}</th>"
        + "".join(f"<td class=number>{escape(texts[index])}</td>" for _, texts in found)
        + "</tr>"
        for index, cell in enumerate(cells)
    )
    return f"<table><thead><tr><th></th>{head}</tr></thead><tbody>{body}</tbody></table>"


def _named(cells: Sequence[CellReport]) -> str:
    def line(cell: CellReport, one: Named) -> str:
        metres, seconds = _number(one.min_separation_m), _number(one.convergence_time_s)
        values = (cell.label, str(one.seed), one.why, metres, seconds, one.what or "")
        texts = "".join(f"<td>{escape(value)}</td>" for value in values)
        return f"<tr>{texts}<td><code>{escape(one.command)}</code></td></tr>"

    head = "".join(f"<th>{word}</th>" for word in ("cell", "seed", "why", "m", "s", "", "flown again by"))
    body = "".join(line(cell, one) for cell in cells for one in cell.named)
    return f"<div class=scroll><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>"


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:g}"
