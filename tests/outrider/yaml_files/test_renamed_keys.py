"""Former names of keys load as the present ones, and say so once, with their place in the file."""

from __future__ import annotations

import pytest

from companion.config import CompanionConfig
from outrider.errors import InputError
from outrider.resources import find
from outrider.scenarios.scenario import Scenario
from outrider.yaml_files import yaml_file
from outrider.yaml_files.yaml_file import read

FORMER = {
    "voice: {texts: true}": "ground_messages: {texts: true}",
    "certified: {helm_us: 1}": "certified: {backup_hover_us: 1}",
    "certified: {stall: {bend: 0.5}}": "certified: {deadlock: {bend: 0.5}}",
    "certified: {stranger_speed: 3.0}": "certified: {noncooperative_speed: 3.0}",
    "certified: {stranger_acceleration: 3.0}": "certified: {noncooperative_acceleration: 3.0}",
}


@pytest.fixture(autouse=True)
def _anew() -> None:
    yaml_file._remark.cache_clear()


@pytest.mark.parametrize("former", FORMER)
def test_a_former_name_loads_as_the_present_one(former: str, capsys: pytest.CaptureFixture[str]) -> None:
    present = read(FORMER[former].encode(), "new.yaml", CompanionConfig)
    assert capsys.readouterr().err == ""
    for _ in range(2):
        assert read(former.encode(), "old.yaml", CompanionConfig) == present
    (line,) = capsys.readouterr().err.splitlines()
    old, new = former.rpartition("{")[2], FORMER[former].rpartition("{")[2]
    assert line.startswith("outrider: old.yaml:1:")
    assert "was renamed to" in line
    assert old != new or "'voice'" in line or "'stall'" in line


def test_it_does_so_inside_other_settings(capsys: pytest.CaptureFixture[str]) -> None:
    text = find("scenarios", "walk").read_text()
    former = text.replace("\ncompanion:\n", "\ncompanion:\n  voice: {texts: true}\n")
    assert read(former.encode(), "walk.yaml", Scenario).companion.ground_messages.texts
    assert "'voice' was renamed to 'ground_messages'" in capsys.readouterr().err


def test_both_names_are_refused() -> None:
    with pytest.raises(InputError, match=r"x\.yaml:1:1: 'voice' and 'ground_messages' are the same key"):
        read(b"voice: {}\nground_messages: {}\n", "x.yaml", CompanionConfig)


def test_the_faults_of_a_former_key_are_at_its_place() -> None:
    with pytest.raises(InputError, match=r"x\.yaml:2:9"):
        read(b"voice:\n texts: 7\n", "x.yaml", CompanionConfig)
