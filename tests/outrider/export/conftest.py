"""Fixtures of the tests of exports: a short flight with all there is, and the command."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from outrider.__main__ import main
from outrider.simulation.preparation import Prepared
from outrider.swarm import command as swarm
from tests.outrider.export.runs import Ended, Export
from tests.outrider.shipped import FIREFLY, scenario


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three vehicles swap places past a post, among things that move."""
    directory = tmp_path_factory.mktemp("flown") / "run"
    directory.mkdir()
    of = scenario(
        "antipodal-8",
        vehicles=3,
        airborne=True,
        cap_s=1.5,
        starts={"radius": 3.0, "jitter": 0.0},
        obstacles=[
            {"kind": "post", "at": [6.0, 6.0], "radius": 0.3, "height": 8.0},
            {"kind": "sphere", "at": [-6.0, 6.0, 5.0], "radius": 0.5},
        ],
        moving=[
            {"kind": "sphere", "through": [[9, 0, 5], [8, 3, 5], [9, 6, 5]], "speed": 1.0, "radius": 0.4},
            {"kind": "post", "through": [[-9, 0], [-8, 3], [-9, 6]], "speed": 1.0, "radius": 0.4},
        ],
    )
    swarm.fly(Prepared(of, FIREFLY), 1, directory, lambda _stage, _seconds: None)
    return directory


@pytest.fixture
def export(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Export:
    """The command as a script sees it."""

    def call(*arguments: object) -> Ended:
        monkeypatch.setattr(sys, "argv", ["outrider", "export", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        code = ended.value.code or 0
        assert isinstance(code, int)
        said = Ended(code, *capsys.readouterr())
        assert "Traceback" not in said.err
        return said

    return call
