"""The command ``outrider`` as a script sees it: exit status, what it prints where, and what it leaves."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest
import yaml

import outrider
from outrider.errors import InputError, OutriderError
from outrider.simulation.flight import Flight
from outrider.swarm import command as swarm
from tests.outrider.said import Ended, Run
from tests.outrider.shipped import LOGS, SCENARIOS

ANTIPODAL, ESCORT = SCENARIOS["antipodal-8"].read_text(), SCENARIOS["escort"].read_text()


@pytest.fixture
def refused(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[str]]:
    """Runs it with bad input, and gives the lines that say so. It must neither fly nor leave anything."""

    def fly(flight: Flight) -> None:
        raise AssertionError("it took off")

    monkeypatch.setattr(Flight, "run", fly)

    def call(*arguments: str) -> list[str]:
        before = {path: path.stat().st_size for path in tmp_path.rglob("*")}
        ended = run(*arguments)
        assert ended.status == 2
        assert ended.out == ""
        assert ended.err.endswith("\n")
        assert "Traceback" not in ended.err
        lines = ended.err[:-1].split("\n")
        assert all(line and line.isprintable() for line in lines)
        assert {path: path.stat().st_size for path in tmp_path.rglob("*")} == before
        return lines

    return call


# Bad input


def test_an_unknown_scenario(refused: Callable[..., list[str]]) -> None:
    (line,) = refused("swarm", "antipodal-9", "--json")
    assert line.startswith("antipodal-9: ")
    assert all(name in line for name in SCENARIOS)
    assert "did you mean 'antipodal-8'?" in line


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("swarm", "escort", "--loss", "20"), "outrider swarm: --loss 20: allowed: a number ≥ 0 and ≤ 1"),
        (("swarm", "escort", "--loss", "much"), "outrider swarm: --loss much: allowed: a number ≥ 0 and ≤ 1"),
        (("swarm", "escort", "--seed", "-1"), "outrider swarm: --seed -1: allowed: a whole number ≥ 0"),
        (
            ("swarm", "escort", "--vehicles", "five"),
            "outrider swarm: --vehicles five: allowed: a whole number",
        ),
        (
            ("export", "runs/mine"),
            "outrider export: Missing option '--format': mcap, csv, parquet or ulog",
        ),
        (
            ("swarm",),
            "outrider swarm: Missing argument 'scenario': A file, or the name of a shipped scenario",
        ),
    ],
)
def test_a_wrong_number_or_a_missing_option_says_what_is_allowed(
    arguments: tuple[str, ...], said: str, refused: Callable[..., list[str]]
) -> None:
    (line,) = refused(*arguments)
    assert line.startswith(f"{said}; see outrider ")


def test_a_log_that_is_not_there_says_what_can_be_replayed(refused: Callable[..., list[str]]) -> None:
    assert refused("replay", "runs/none") == [
        "runs/none: no such file or directory; allowed: a .tlog, a .tlog.gz, or the directory of a run"
    ]


@pytest.mark.parametrize("name", ["nowhere.yaml", "nowhere/scenario.yaml", "a folder/x.yml"])
def test_a_missing_file(name: str, refused: Callable[..., list[str]], tmp_path: Path) -> None:
    (tmp_path / "a folder").mkdir()
    (line,) = refused("swarm", name)
    assert line.startswith(f"{name}: ")
    assert "no such file" in line


class Wrong(NamedTuple):
    """A shipped text with ``old`` replaced by ``new``, and the places and words of its faults."""

    text: str
    old: str
    new: str
    faults: tuple[tuple[str, str], ...]


def place(text: str, word: str) -> str:
    """line:column of a word that is there once."""
    assert text.count(word) == 1
    before = text[: text.index(word)]
    return f"{before.count(chr(10)) + 1}:{len(before) - before.rfind(chr(10))}"


WRONG = {
    "unknown key": Wrong(ANTIPODAL, "description:", "descripton:", (("descripton", "'description'?"),)),
    "unknown inner key": Wrong(ANTIPODAL, "jitter: 0.3", "jiter: 0.3", (("jiter", "'jitter'?"),)),
    "wrong type": Wrong(ANTIPODAL, "vehicles: 8", "vehicles: eighty", (("eighty", "vehicles"),)),
    "text for a number": Wrong(ANTIPODAL, "radius: 8.0", "radius: '8.25'", (("'8.25'", "starts.radius"),)),
    "impossible value": Wrong(ANTIPODAL, "vehicles: 8", "vehicles: -81", (("-81", "vehicles"),)),
    "not a number": Wrong(ANTIPODAL, "radius: 8.0", "radius: .nan", ((".nan", "finite"),)),
    "no such word": Wrong(ANTIPODAL, "task: goto", "task: gotoo", (("gotoo", "did you mean 'goto'?"),)),
    "no such kind": Wrong(ESCORT, "kind: recorded", "kind: recordet", (("recordet", "'recorded'"),)),
    "syntax": Wrong(ANTIPODAL, "radius: 8.0,", "radius: 8.0, ]", (("] height", "not YAML"),)),
    "a rule": Wrong(
        ANTIPODAL,
        "task: goto",
        "task: goto\n  limits: {a_total: 1.0}",
        (("{a_total", "a_total must be at least the largest u_max"),),
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_fault_in_a_file_is_named_with_its_place(
    name: str, refused: Callable[..., list[str]], tmp_path: Path
) -> None:
    wrong = WRONG[name]
    assert wrong.text.count(wrong.old) == 1
    text = wrong.text.replace(wrong.old, wrong.new)
    (tmp_path / "my.yaml").write_text(text)
    lines = refused("swarm", "my.yaml", "--json")
    assert len(lines) == len(wrong.faults)
    for line, (word, said) in zip(lines, wrong.faults, strict=True):
        assert line.startswith(f"my.yaml:{place(text, word)}: ")
        assert said in line


def test_every_fault_of_a_file_is_a_line_in_the_order_of_the_file(
    refused: Callable[..., list[str]], tmp_path: Path
) -> None:
    text = ANTIPODAL.replace("vehicles: 8", "vehicels: 8").replace("radius: 8.0", "radius: big")
    (tmp_path / "my.yaml").write_text(text)
    lines = refused("swarm", "my.yaml")
    places = [tuple(map(int, line.split(":")[1:3])) for line in lines]
    # The mistyped key is unknown, and the one that was meant is missing.
    assert len(lines) == 3
    assert places == sorted(places)


def test_an_empty_file(refused: Callable[..., list[str]], tmp_path: Path) -> None:
    (tmp_path / "my.yaml").touch()
    (line,) = refused("swarm", "my.yaml")
    assert line.startswith("my.yaml:1:1: is empty")


def test_a_vehicle_that_does_not_exist(refused: Callable[..., list[str]], tmp_path: Path) -> None:
    (tmp_path / "my.yaml").write_text(ANTIPODAL + "vehicle: firefli\n")
    (line,) = refused("swarm", "my.yaml")
    assert "firefli: " in line
    assert "did you mean 'firefly'?" in line


@pytest.mark.parametrize("damage", ["cut", "missing", "noise", "other system"])
def test_a_log_that_cannot_be_flown(damage: str, refused: Callable[..., list[str]], tmp_path: Path) -> None:
    log, text = tmp_path / "target.tlog", ESCORT
    good = (LOGS / "escort-target.tlog").read_bytes()
    if damage == "cut":
        log.write_bytes(good[: len(good) // 2 + 3])
    elif damage == "noise":
        log.write_bytes(b"\0\1\2\3" * 1000)
    elif damage == "other system":
        log.write_bytes(good)
        text = text.replace("system: 1,", "system: 7,")
    (tmp_path / "my.yaml").write_text(text.replace("escort-target.tlog,", f"{json.dumps(str(log))},"))
    for options in ([], ["--out", "run"], ["--json"]):
        (line,) = refused("swarm", "my.yaml", *options)
        assert line.startswith(f"{log}: ")


def test_an_out_that_holds_something(refused: Callable[..., list[str]], tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "notes.txt").write_text("mine")
    (line,) = refused("swarm", "antipodal-8", "--out", "run")
    assert line.startswith("--out run: ")
    (line,) = refused("swarm", "antipodal-8", "--out", "run/notes.txt")
    assert line.startswith("--out run/notes.txt: ")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--vehicles", "0"], "--vehicles"),
        (["--vehicles", "many"], "--vehicles"),
        (["--seed", "-1"], "--seed"),
        (["--loss", "1.5"], "--loss"),
        (["--loss", "nan"], "--loss"),
        (["--delay-ms", "-5"], "--delay-ms"),
        (["--method", "tangentail"], "'tangentail'"),
        (["--avoidance", "certifed"], "--avoidance"),
        (["--sensors", "gps"], "--sensors"),
        (["--replan-hz", "nan"], "--replan-hz"),
        (["--replan-hz", "33"], "--replan-hz"),
        (["--sed", "1"], "--seed"),
        (["--seed"], "--seed"),
        (["a second scenario"], "a second scenario"),
    ],
)
def test_a_bad_option(arguments: list[str], said: str, refused: Callable[..., list[str]]) -> None:
    (line,) = refused("swarm", "antipodal-8", *arguments)
    assert said in line


@pytest.mark.parametrize("arguments", [["swarm"], ["swrm", "escort"], ["--nonsense"]])
def test_a_bad_command(arguments: list[str], refused: Callable[..., list[str]]) -> None:
    (line,) = refused(*arguments)
    assert re.match(r"outrider( swarm)?: ", line)


def test_control_characters_of_an_argument_do_not_reach_the_terminal(
    refused: Callable[..., list[str]],
) -> None:
    (line,) = refused("swarm", "no\nsuch\x1b[31m")
    assert line.startswith(r"no\nsuch\x1b[31m: ")


# Other ends


def test_help_is_no_error(run: Run) -> None:
    for arguments in (["--help"], ["swarm", "--help"]):
        ended = run(*arguments)
        assert (ended.status, ended.err) == (0, "")
        assert "Usage" in ended.out


@pytest.mark.parametrize(
    ("error", "status", "said"),
    [
        (InputError("a: wrong", "b: wrong"), 2, "a: wrong\nb: wrong\n"),
        (OutriderError("broken"), 3, "outrider: broken\n"),
        (OSError("no space"), 3, "outrider: no space\n"),
    ],
)
def test_what_ends_how(
    error: Exception, status: int, said: str, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise error

    monkeypatch.setattr(swarm, "fly", fail)
    assert run("swarm", "antipodal-8") == Ended(status, "", said)


LONELY = ("swarm", "antipodal-8", "--vehicles", "1", "--replan-hz", "10", "--out", "run")


def test_a_flight_ends_with_one_json_object_and_a_full_directory(run: Run, tmp_path: Path) -> None:
    ended = run(*LONELY, "--json")
    assert (ended.status, ended.err) == (0, "")
    assert ended.out.count("\n") == 1
    summary = json.loads(ended.out)
    assert (summary["vehicles"], summary["converged"], summary["run_dir"]) == (1, True, "run")
    assert summary["min_separation_m"] is None
    assert sorted(path.name for path in (tmp_path / "run").iterdir()) == [
        "configuration.yaml",
        "flight.npz",
        "flight.png",
        "plan_times.npz",
        "plans.npz",
        "report.html",
        "summary.json",
        "vehicle-11.steps.npz",
        "vehicle-11.tlog",
    ]
    assert json.loads((tmp_path / "run" / "summary.json").read_text()) == summary
    assert (tmp_path / "run" / "flight.png").read_bytes().startswith(b"\x89PNG")


def test_a_goal_that_is_not_reached_ends_with_1_and_a_table(run: Run, tmp_path: Path) -> None:
    text = ANTIPODAL.replace("vehicles: 8", "vehicles: 1\ncap_s: 1")
    (tmp_path / "my.yaml").write_text(text)
    ended = run("swarm", "my.yaml", "--replan-hz", "10", "--planar", "--seed", "3")
    assert (ended.status, ended.err) == (1, "")
    assert "antipodal-8 · tangential · seed 3" in ended.out
    assert "{" not in ended.out
    assert [path.name for path in (tmp_path / "runs").iterdir()] == [
        "antipodal-8-tangential-planar-replan10-seed3"
    ]


def test_plans_that_are_far_apart_in_a_file_are_warned_of(run: Run, tmp_path: Path) -> None:
    text = ANTIPODAL.replace("vehicles: 8", "vehicles: 1\ncap_s: 1")
    document = yaml.safe_load(text)
    document["companion"] = {**document.get("companion", {}), "rates": {"replan_us": 100_000}}
    (tmp_path / "my.yaml").write_text(yaml.safe_dump(document))
    (said,) = run("swarm", "my.yaml").err.splitlines()
    assert "100000 µs between plans" in said


# Conventions


def test_the_version_and_short_help(run: Run) -> None:
    assert run("--version").out == f"outrider {outrider.__version__}\n"
    for words in ((), ("swarm",), ("list",)):
        assert run(*words, "-h").out == run(*words, "--help").out


def test_help_breaks_no_sentence(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "300")
    assert (
        "send the same messages again? Exits with 1 if not, or if there are findings."
        in run("replay", "-h").out
    )


def test_names_are_completed_in_a_shell(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("_OUTRIDER_COMPLETE", "complete_bash")
    for words, wanted in (
        ("outrider swarm antipodal-", ["antipodal-16", "antipodal-8"]),
        ("outrider sweep smo", ["smoke"]),
        ("outrider repl", ["replay"]),
    ):
        monkeypatch.setenv("COMP_WORDS", words)
        monkeypatch.setenv("COMP_CWORD", str(len(words.split()) - 1))
        assert run().out.split() == wanted
