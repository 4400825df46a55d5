"""A flown run, and the command, for the tests of ``certify``."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pytest

from outrider.__main__ import main
from tests.outrider.certify.runs import Ended, Replay, fly


@pytest.fixture(scope="session")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of a scenario."""
    return fly(tmp_path_factory.mktemp("flown") / "run", 3)


@pytest.fixture
def run(flown: Path, tmp_path: Path) -> Path:
    """A copy that may be spoilt."""
    return Path(shutil.copytree(flown, tmp_path / "run"))


@pytest.fixture
def replay(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Replay:
    """The command as a script sees it."""

    def call(*arguments: object) -> Ended:
        monkeypatch.setattr(sys, "argv", ["outrider", "replay", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        code = ended.value.code
        assert isinstance(code, int)
        said = Ended(code, *capsys.readouterr())
        assert "Traceback" not in said.err
        return said

    return call
