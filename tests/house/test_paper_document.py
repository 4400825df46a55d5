"""docs/paper.md has a row for every equation and figure, and names symbols whose docstrings agree."""

from __future__ import annotations

import re
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import pytest

DOCS = Path(__file__).parents[2] / "docs"
TEXT = (DOCS / "paper.md").read_text(encoding="utf-8")
EQUATIONS = 18
"""Numbered displays in the paper's source; docs/paper.md says how they were counted."""
FIGURES = (
    "Fig. 1",
    "Fig. 2 (a)",
    "Fig. 2 (b)",
    "Fig. 2 (c)",
    "Fig. 2 (d)",
    "Fig. 7",
    "Table I (a)",
    "Table I (b)",
)
WIDEST = 160
SYMBOL = re.compile(r"`((?:companion|mavlink_bridge|outrider|sitl)(?:\.\w+)+)`")
REFERENCE = re.compile(r"\beqs?\. (\(\d+\)(?:(?:,? and | to |, )\(\d+\))*)", re.IGNORECASE)


class Row(NamedTuple):
    """One row of a table."""

    number: str
    words: str
    symbol: str
    settled: str


class Found(NamedTuple):
    """An object and the module that it was reached through."""

    value: Any
    module: ModuleType


def section(title: str) -> str:
    """The text from that heading to the next."""
    return TEXT.split(f"\n## {title}\n")[1].split("\n## ")[0]


def rows(title: str) -> list[Row]:
    """The rows of the table in that section."""
    lines = [line for line in section(title).splitlines() if line.startswith("| ")]
    cells = [[cell.strip() for cell in line.strip("|").split(" | ")] for line in lines]
    assert cells[0] == ["number", "in words", "symbol", "settled"]
    return [Row(*row) for row in cells[1:]]


def found(symbol: str) -> Found:
    """What a dotted path leads to: a module, or an attribute of one."""
    parts = symbol.split(".")
    count = 1
    while count < len(parts) and find_spec(".".join(parts[: count + 1])) is not None:
        count += 1
        if not hasattr(import_module(".".join(parts[:count])), "__path__"):
            break
    module = import_module(".".join(parts[:count]))
    value: Any = module
    for name in parts[count:]:
        value = getattr(value, name)
    return Found(value, module)


def named(text: str) -> set[int]:
    """The equations that a text names: "eq. (1)", "eqs. (2) to (7)", "eqs. (9), (10) and (12)"."""
    numbers = set()
    for reference in REFERENCE.findall(" ".join(text.split())):
        for part in re.split(r",? and |, ", reference):
            ends = [int(end) for end in re.findall(r"\d+", part)]
            numbers.update(range(ends[0], ends[-1] + 1))
    return numbers


TABLES = ("Equations", "Claims and algorithm steps", "Figures and tables")
EQUATION_ROWS = rows(TABLES[0])


def test_every_equation_has_one_row() -> None:
    assert [row.number for row in EQUATION_ROWS] == [f"({n})" for n in range(1, EQUATIONS + 1)]


def test_every_step_and_figure_has_one_row() -> None:
    claims, figures = ([row.number for row in rows(title)] for title in TABLES[1:])
    steps, others = claims[:5], claims[5:]
    assert steps == [f"A{n}" for n in range(1, 6)]
    assert others == [f"C{n}" for n in range(1, len(others) + 1)]
    assert len(set(figures)) == len(figures)
    assert set(figures) == {*FIGURES, *(f"Fig. {n} (a)–(f)" for n in range(3, 7)), "Video"}


@pytest.mark.parametrize("title", TABLES)
def test_every_row_has_one_symbol(title: str) -> None:
    assert [row.number for row in rows(title) if not SYMBOL.fullmatch(row.symbol)] == []


@pytest.mark.parametrize("symbol", sorted(set(SYMBOL.findall(TEXT))))
def test_every_symbol_exists(symbol: str) -> None:
    found(symbol)


@pytest.mark.parametrize("row", EQUATION_ROWS, ids=lambda row: row.number)
def test_the_docstring_of_the_symbol_or_of_its_module_names_the_equation(row: Row) -> None:
    value, module = found(row.symbol.strip("`"))
    docstrings = f"{value.__doc__}\n\n{module.__doc__}"
    assert int(row.number.strip("()")) in named(docstrings)


@pytest.mark.parametrize("title", TABLES)
def test_what_differs_from_the_paper_has_a_known_word_and_a_reason(title: str) -> None:
    known = re.findall(r"^\| ([a-z ]+) \| [A-Z]", TEXT.split("\n## ")[0], re.MULTILINE)
    table = rows(title)
    assert {row.settled.split(":")[0] for row in table} <= set(known)
    reasons = section(title).split("\nReasons:\n")[1]
    differing = [row.number for row in table if row.settled != "as printed"]
    starts = [line for line in reasons.splitlines() if line.startswith("- ")]
    assert len(starts) == len(differing)
    assert [n for n, start in zip(differing, starts, strict=True) if not start.startswith(f"- {n} ")] == []


def test_what_the_page_leads_to_is_there() -> None:
    links = set(re.findall(r"\]\(([\w./-]+)\)", TEXT))
    files = set(re.findall(r"`((?:tests|tools|config)/[\w./-]+)`", TEXT))
    assert [link for link in links if not (DOCS / link).is_file()] == []
    assert [file for file in files if not (DOCS.parent / file).is_file()] == []


def test_no_line_is_too_wide() -> None:
    assert [line for line in TEXT.splitlines() if len(line) > WIDEST] == []


def test_references_are_read_as_they_are_meant() -> None:
    assert named("the paper, eqs. (2) to\n(4), and eq. (7)") == {2, 3, 4, 7}
    assert named("eqs. (9), (10) and (12); (13)") == {9, 10, 12}
    assert named("Eq. (5)") == {5}
    assert named("N + 1 (6)") == set()
