"""``outrider report``: one page that needs nothing but itself, of whole runs and of what is left."""

from __future__ import annotations

import base64
import hashlib
import json
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from outrider.__main__ import main
from outrider.report.command import make
from outrider.report.page import SCRIPTS, STYLES, static
from tests.outrider.report.runs import leave

NODE = shutil.which("node")


class Ended(NamedTuple):
    status: int
    out: str
    err: str


Run = Callable[..., Ended]


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    """Runs ``outrider`` with arguments."""

    def call(*arguments: str | Path) -> Ended:
        monkeypatch.setattr(sys, "argv", ["outrider", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        code = ended.value.code
        assert code is None or isinstance(code, int)
        return Ended(code or 0, *capsys.readouterr())

    return call


class Page(HTMLParser):
    """What a browser would see of a page: its elements with their attributes, and its text."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.within: dict[str, list[str]] = {}
        self.text = ""
        self._open = ""
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attributes)))
        self._open = tag
        self.within.setdefault(tag, []).append("")

    def handle_endtag(self, tag: str) -> None:
        self._open = ""

    def handle_data(self, data: str) -> None:
        if self._open in self.within:
            self.within[self._open][-1] += data
        if self._open not in ("script", "style"):
            self.text += data


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> str:
    """That of a usual run."""
    return make(leave(tmp_path_factory.mktemp("run")).directory).text


# Needs nothing but itself


def test_nothing_on_the_page_is_from_elsewhere(page: str) -> None:
    seen = Page(page)
    for tag, attributes in seen.elements:
        assert tag not in ("link", "iframe", "object", "embed", "img", "base", "form", "a")
        assert not {"src", "href", "srcset", "action", "data", "style"} & set(attributes), tag
        assert not any(name.startswith("on") for name in attributes), tag
        assert not any("//" in (value or "") for value in attributes.values()), tag
    for name in (*STYLES, *SCRIPTS):
        text = static(name).replace(
            '"http://www.w3.org/2000/svg"', ""
        )  # the name of SVG, which nobody fetches
        for word in (
            "http:",
            "https:",
            "url(",
            "@import",
            "import(",
            "fetch(",
            "XMLHttp",
            "WebSocket",
            "eval(",
        ):
            assert word not in text, f"{name}: {word}"


def test_the_policy_lets_nothing_in(page: str) -> None:
    seen = Page(page)
    (policy,) = (
        attributes["content"]
        for tag, attributes in seen.elements
        if tag == "meta" and attributes.get("http-equiv") == "Content-Security-Policy"
    )
    assert policy is not None
    rules = dict(rule.strip().split(" ", 1) for rule in policy.split(";"))
    assert rules["default-src"] == "'none'"
    assert set(rules) == {"default-src", "style-src", "script-src", "base-uri", "form-action"}
    for rule, tag in (("style-src", "style"), ("script-src", "script")):
        digest = hashlib.sha256(seen.within[tag][-1].encode()).digest()
        assert rules[rule] == f"'sha256-{base64.b64encode(digest).decode()}'"
    first = next(tag for tag, _ in seen.elements if tag in ("style", "script"))
    assert page.index("Content-Security-Policy") < page.index(f"<{first}")


def test_a_minute_of_eight_is_small(tmp_path: Path) -> None:
    text = make(leave(tmp_path, vehicles=8, seconds=60.0, logs=False).directory).text
    assert len(text.encode()) < 2_000_000


def test_the_same_run_gives_the_same_page(tmp_path: Path) -> None:
    directory = leave(tmp_path).directory
    assert make(directory).text == make(directory).text


# What a log brings in stays text

EVIL = "</script><script>alert(1)</script><img src=x onerror=alert(2)>"


def test_no_log_runs_a_program(tmp_path: Path) -> None:
    short = "<script>alert(1)</script><img src=x onerror=a()>"
    made = leave(tmp_path, text=short, method=EVIL, sensors=EVIL, failure=EVIL, **{EVIL: {EVIL: EVIL}})
    configuration = made.directory / "configuration.yaml"
    configuration.write_text(configuration.read_text() + f"# {EVIL} \"' {{{{script}}}}\n")
    usual = Page(make(leave(tmp_path / "usual").directory).text)
    text = make(made.directory).text
    seen = Page(text)
    count = [tag for tag, _ in seen.elements].count
    for tag in ("script", "img", "style", "meta", "input"):
        assert count(tag) == [tag for tag, _ in usual.elements].count(tag)
    assert f"info: {short}" in seen.text
    assert f"Failed: {EVIL}" in seen.text
    assert "{{script}}" in seen.text


def test_a_scenario_by_a_bad_name_is_text(tmp_path: Path) -> None:
    directory = leave(tmp_path, converged=None).directory
    (directory / "configuration.yaml").unlink()
    summary = json.loads((directory / "summary.json").read_text())
    (directory / "summary.json").write_text(json.dumps({**summary, "scenario": EVIL}))
    seen = Page(make(directory).text)
    assert EVIL in seen.within["title"][0]
    assert [tag for tag, _ in seen.elements].count("script") == 2


# How it ended


@pytest.mark.parametrize(
    ("summary", "said"),
    [
        ({}, "Converged in 7.5 s"),
        ({"converged": False, "convergence_time_s": None}, "Stuck: not converged in 60 s"),
        (
            {"converged": False, "convergence_time_s": None, "others_converge_s": 6.2},
            "Stuck: not converged; those whose companion did not end, in 6.2 s",
        ),
        ({"d_min_violations": 1}, "One violation of d_min; converged in 7.5 s"),
        ({"d_min_violations": 3, "converged": None}, "3 violations of d_min"),
        ({"failure": "vehicle 12 came down"}, "Failed: vehicle 12 came down"),
        ({"converged": None, "convergence_time_s": None}, "Flown to the end"),
    ],
)
def test_the_headline(summary: dict[str, object], said: str, tmp_path: Path) -> None:
    seen = Page(make(leave(tmp_path, logs=False, **summary).directory).text)
    assert seen.within["h1"] == [said]


def test_a_run_in_real_time_says_how_late_it_was(tmp_path: Path) -> None:
    late = {"deadline_misses": 7, "deadline_steps": 900, "lateness_ms": {"p50": 0.1, "p99": 0.4, "max": 9.0}}
    text = Page(make(leave(tmp_path, logs=False, **late).directory).text).text
    assert "deadlines missed" in text
    assert "of 900" in text
    assert "p50 0.1, p99 0.4, max 9 ms" in text


# What is missing

PARTS = ("summary.json", "configuration.yaml", "flight.npz", "plans.npz", "plan_times.npz", "vehicle-12.tlog")


@pytest.mark.parametrize("damage", ["gone", "empty", "cut", "noise", "a folder"])
@pytest.mark.parametrize("name", PARTS)
def test_a_part_that_is_missing_is_named(name: str, damage: str, run: Run, tmp_path: Path) -> None:
    directory = leave(tmp_path, seconds=1.0).directory
    path, data = directory / name, (directory / name).read_bytes()
    path.unlink()
    if damage == "a folder":
        path.mkdir()
    elif damage != "gone":
        path.write_bytes(
            {"empty": b"", "cut": data[: len(data) // 20], "noise": b"\0\xfe\xfd~" * 999}[damage]
        )
    ended = run("report", directory)
    assert ended.status == 0
    assert name in ended.err
    assert str(directory) not in ended.err
    assert "Traceback" not in ended.err
    text = (directory / "report.html").read_text()
    assert f"<code>{name}</code>" in text
    assert str(directory) not in text


def test_no_damage_escapes(tmp_path: Path) -> None:
    directory = leave(tmp_path, vehicles=2, seconds=1.0).directory
    random = np.random.default_rng(1)
    for path in sorted(directory.iterdir()):
        good = path.read_bytes()
        for _ in range(12):
            data = bytearray(good)
            for place in random.integers(len(data), size=random.integers(1, 20)).tolist():
                data[place] = random.integers(256)
            path.write_bytes(data)
            page = make(directory).text
            assert page.endswith("</html>\n")
        path.write_bytes(good)


def test_all_that_is_there_is_a_log(run: Run, tmp_path: Path) -> None:
    directory = leave(tmp_path).directory
    for name in PARTS[:-1]:
        (directory / name).unlink()
    ended = run("report", directory, "--json")
    assert ended.status == 0
    told = json.loads(ended.out)
    assert [gap["what"] for gap in told["missing"]] == list(PARTS[:-1])
    assert told["lost"] == 0.0


@pytest.mark.parametrize("what", ["nothing", "a file", "empty", "others' files", "damaged"])
def test_what_is_no_run_ends_with_2_and_one_line(what: str, run: Run, tmp_path: Path) -> None:
    directory = tmp_path / "run"
    if what == "a file":
        directory.write_text("mine")
    elif what != "nothing":
        directory.mkdir()
    if what == "others' files":
        (directory / "notes.txt").write_text("mine")
    elif what == "damaged":
        (directory / "flight.npz").write_text("mine")
    ended = run("report", directory)
    assert (ended.status, ended.out) == (2, "")
    assert ended.err.count("\n") == 1
    assert ended.err.startswith(f"{directory}: ")
    assert not list(tmp_path.rglob("*.html"))


# Where it is written


def test_it_replaces_its_own_earlier_page_and_nothing_else(run: Run, tmp_path: Path) -> None:
    directory = leave(tmp_path / "run", logs=False).directory
    page = directory / "report.html"
    assert run("report", directory) == Ended(0, f"{page}\n", run("report", directory).err)
    page.write_text("<!doctype html><p>mine</p>")
    ended = run("report", directory)
    assert (ended.status, ended.err.count("\n")) == (2, 1)
    assert page.read_text() == "<!doctype html><p>mine</p>"
    assert not list(directory.glob(".report*"))


def test_out(run: Run, tmp_path: Path) -> None:
    directory = leave(tmp_path / "run", logs=False).directory
    mine = tmp_path / "mine.txt"
    mine.write_text("mine")
    assert run("report", directory, "--out", mine).status == 2
    assert run("report", directory, "--out", tmp_path / "no" / "page.html").status == 2
    assert run("report", directory, "--out", directory).status == 2
    assert mine.read_text() == "mine"
    for _ in range(2):
        assert run("report", directory, "--out", tmp_path / "page.html").status == 0
    assert not (directory / "report.html").exists()


def test_json(run: Run, tmp_path: Path) -> None:
    directory = leave(tmp_path, lost=lambda sender, receiver, n: n % 4 == 0).directory
    ended = run("report", directory, "--json")
    assert (ended.status, ended.err, ended.out.count("\n")) == (0, "", 1)
    told = json.loads(ended.out)
    assert told["report"] == str(directory / "report.html")
    assert told["bytes"] == (directory / "report.html").stat().st_size
    assert told["missing"] == []
    assert told["lost"] == pytest.approx(65 / 143, abs=1e-4)


# A flight


@pytest.mark.slow
def test_a_flown_run_loses_what_it_was_told_to(run: Run, tmp_path: Path) -> None:
    options = ("--vehicles", "3", "--replan-hz", "10", "--loss", "0.2", "--out", tmp_path / "run", "--json")
    assert run("swarm", "antipodal-8", *options).status == 0
    made = make(tmp_path / "run")
    assert made.run.gaps == ()
    sent = sum(way.sent for way in made.losses.ways)
    assert made.losses.share == pytest.approx(0.2, abs=4.0 * np.sqrt(0.2 * 0.8 / sent))
    (armed,) = (event for event in made.events if event.text == "armed")
    (goal,) = (event for event in made.events if event.kind == "goal")
    assert armed.who == (11, 12, 13)
    assert armed.time < goal.time == 0.0


# Its program


@pytest.mark.skipif(NODE is None, reason="node is not installed")
@pytest.mark.parametrize("name", SCRIPTS)
def test_every_script_parses(name: str, tmp_path: Path) -> None:
    assert NODE is not None
    path = tmp_path / name
    path.write_text('"use strict";\n' + static(name))
    done = subprocess.run([NODE, "--check", str(path)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_scripts_and_styles_are_all_that_lies_there() -> None:
    folder = Path(sys.modules["outrider.report"].__file__ or "").parent / "static"
    assert {path.name for path in folder.iterdir()} == {"page.html", *STYLES, *SCRIPTS}
    for path in folder.iterdir():
        lines = path.read_text().splitlines()
        assert len(lines) <= 200, path.name
        assert not re.search(r"</(script|style)", path.read_text()) or path.name == "page.html"
