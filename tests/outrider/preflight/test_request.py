"""What ``outrider preflight`` is asked for is refused before a link is opened, with what is allowed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from outrider.errors import InputError
from outrider.preflight.command import Options, checked, preflight
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
