"""What ``outrider preflight`` is asked for is refused before a link is opened, with what is allowed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from outrider.errors import InputError
from outrider.preflight.command import Options, checked, preflight
from outrider.preflight.course import Box
from outrider.resources import find

ASKED = Options("udpin:127.0.0.1:14550", "mcast:,127.0.0.1", "px4", system=1, roster="1,2")


def test_a_file_and_a_roster_suffice() -> None:
    terms = checked(ASKED).terms
    assert (terms.system, terms.config.certified.fleet, terms.others) == (1, (1, 2), (2,))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"system": None}, "--system: is missing"),
        ({"roster": None}, "--roster: is missing"),
        ({"roster": "1"}, "two vehicles at least"),
        ({"roster": "2,3"}, "the own id 1 among them"),
        ({"roster": "1,,2"}, "joined by commas"),
        ({"roster": "1,2,2"}, "different system ids"),
        ({"roster": "1,251"}, "1…250"),
        ({"roster": "1,٣"}, "joined by commas"),
        ({"autopilot": "udp:1"}, "--autopilot"),
        ({"swarm": "tlog:flight.tlog"}, "a log answers nothing"),
        ({"config": "px5"}, "did you mean 'px4'"),
        ({"go": True}, "allowed with it: --fly"),
        ({"box": "8,8,3"}, "allowed with it: --fly"),
        ({"fly": True, "flight": Path("flight.tlog")}, "--flight"),
        ({"fly": True, "go": True, "dry_run": True}, "nothing takes off"),
        ({"fly": True, "box": "8,8"}, "EAST,NORTH,UP"),
        ({"fly": True, "box": "8,8,nan"}, "EAST,NORTH,UP"),
        ({"fly": True, "box": "3,8,3"}, "4 to 60"),
        ({"fly": True, "box": "8,-61,3"}, "4 to 60"),
        ({"fly": True, "box": "8,8,-3"}, "1 to 20 up"),
    ],
)
def test_bad_input_names_what_is_allowed(changes: dict[str, object], words: str) -> None:
    with pytest.raises(InputError, match=words):
        checked(replace(ASKED, **changes))  # type: ignore[arg-type]


def test_a_roster_that_is_not_the_files_is_refused(tmp_path: Path) -> None:
    text = find("companions", "px4").read_text(encoding="utf-8")
    own = tmp_path / "own.yaml"
    own.write_text(text.replace("  task: escort", "  certified: {fleet: [1, 2, 3]}\n  task: escort"))
    with pytest.raises(InputError, match="the file names 1, 2, 3"):
        checked(replace(ASKED, config=str(own)))
    assert checked(replace(ASKED, config=str(own), roster=None)).terms.others == (2, 3)


def test_a_file_that_could_not_be_written_is_refused_before_anything_is_measured(tmp_path: Path) -> None:
    for out in (tmp_path, tmp_path / "nowhere" / "fleet.yaml"):
        with pytest.raises(InputError, match="--out"):
            preflight(replace(ASKED, out=out))


@pytest.mark.parametrize(("line", "words"), [("radio: 57600", "radio: null"), ("clock: autopilot", "wall")])
def test_a_file_with_which_committed_plans_cannot_be_flown_is_refused(
    line: str, words: str, tmp_path: Path
) -> None:
    own = tmp_path / "own.yaml"
    own.write_text(f"{line}\n" + find("companions", "px4").read_text(encoding="utf-8"))
    checked(replace(ASKED, config=str(own)))
    with pytest.raises(InputError, match=words):
        checked(replace(ASKED, config=str(own), fly=True))


def test_the_course_has_a_size_and_the_height_of_the_file() -> None:
    fly = checked(replace(ASKED, fly=True)).terms.fly
    assert fly is not None
    assert (fly.box, fly.height, fly.go, fly.dry) == (Box(8.0, 8.0, 3.0), 5.0, False, False)
    fly = checked(replace(ASKED, fly=True, box="-6,10,2", dry_run=True)).terms.fly
    assert fly is not None
    assert (fly.box, fly.dry) == (Box(-6.0, 10.0, 2.0), True)
    assert checked(ASKED).terms.fly is None
