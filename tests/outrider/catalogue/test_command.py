"""``outrider list`` and ``outrider new``: all that is shipped has a line, and copies are valid files."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from companion.config import CompanionConfig
from outrider.catalogue.shipped import KINDS, items
from outrider.resources import config_root, find
from outrider.scenarios.cameras import CameraFile
from outrider.scenarios.fly_config import FlyConfig
from outrider.scenarios.scenario import Scenario
from outrider.yaml_files.yaml_file import load
from sitl.vehicle.config import VehicleConfig
from tests.outrider.said import Run
from tests.outrider.shipped import SCENARIOS


def test_every_shipped_file_has_a_name_and_a_line(run: Run) -> None:
    told = json.loads(run("list", "--json").out)
    assert list(told) == [*KINDS, "runs"]
    assert [one["name"] for one in told["scenarios"]] == list(SCENARIOS)
    for kind in KINDS:
        assert told[kind]
        for one in told[kind]:
            assert find(kind, one["name"])
            assert 5 < len(one["description"]) < 200
            assert "\n" not in one["description"]


def test_the_list_of_one_kind_is_lines(run: Run) -> None:
    ended = run("list", "scenarios")
    assert ended.status == 0
    head, *lines = ended.out.splitlines()
    assert head == "scenarios"
    assert [line.split()[0] for line in lines] == list(SCENARIOS)


def test_runs_say_how_they_ended(run: Run, tmp_path: Path) -> None:
    for name, summary in (
        ("one", {"converged": True, "convergence_time_s": 7.5, "min_separation_m": 1.234}),
        ("two", {"converged": False, "d_min_violations": 2}),
        ("three", None),
    ):
        folder = tmp_path / "runs" / name
        folder.mkdir(parents=True)
        (folder / "configuration.yaml").write_text("")
        if summary is not None:
            (folder / "summary.json").write_text(json.dumps(summary))
    assert dict(items("runs")) == {
        "runs/one": "converged after 7.5 s, least separation 1.23 m",
        "runs/two": "not converged, 2 violations of d_min",
        "runs/three": "not finished",
    }


@pytest.mark.parametrize(
    ("kind", "like", "model"),
    [
        ("scenario", "escort", Scenario),
        ("scenario", "rough", Scenario),
        ("vehicle", "firefly", VehicleConfig),
        ("companion", "px4", FlyConfig),
        ("camera", "walker", CameraFile),
    ],
)
def test_a_copy_is_valid_and_its_schema_is_found(
    run: Run, tmp_path: Path, kind: str, like: str, model: type[CompanionConfig]
) -> None:
    ended = run("new", "my own.yaml", "--like", like, "--kind", kind)
    assert ended.status == 0
    assert ended.out.startswith("my own.yaml: a copy of ")
    copy = tmp_path / "my own.yaml"
    text = copy.read_text(encoding="utf-8")
    found = re.match(r"# yaml-language-server: \$schema=(.*)\n", text)
    assert found is not None
    assert Path(found[1]).is_file()
    assert Path(found[1]).parent == config_root() / "schemas"
    value = load(copy, model)
    if kind not in ("companion", "camera"):
        assert value.name == "my-own"  # type: ignore[attr-defined]
    comments = [line for line in find(f"{kind}s", like).read_text().splitlines() if line.startswith("#")]
    assert set(comments[1:]) <= set(text.splitlines())


def test_nothing_is_overwritten_and_words_are_checked(run: Run, tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text("mine")
    for words, said in (
        (("new", "mine.yaml"), "mine.yaml: exists"),
        (("new", "a.yaml", "--like", "escrot"), "did you mean 'escort'?"),
        (("new", "a.yaml", "--kind", "vehicel"), "did you mean 'vehicle'?"),
        (("new", "nowhere/a.yaml"), "cannot be written"),
        (("list", "scenario"), "did you mean 'scenarios'?"),
    ):
        ended = run(*words)
        assert ended.status == 2
        assert said in ended.err
    assert (tmp_path / "mine.yaml").read_text() == "mine"
