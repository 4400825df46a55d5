"""``--physics``: allowed words, weather that only JSBSim makes, a missing package."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from outrider.errors import InputError
from outrider.scenarios.options import Options
from outrider.simulation.preparation import prepare
from tests.outrider.said import Run
from tests.outrider.shipped import SCENARIOS

ANTIPODAL = SCENARIOS["antipodal-8"].read_text()


def test_it_is_another_physics_and_nothing_else() -> None:
    pytest.importorskip("jsbsim", reason="there is no wheel of JSBSim for this machine")
    before, after = (prepare("antipodal-8", Options(physics=name)) for name in ("own", "jsbsim"))
    assert (before.scenario.physics, after.scenario.physics) == ("own", "jsbsim")
    assert after.scenario.model_copy(update={"physics": "own"}) == before.scenario
    assert prepare("antipodal-8", Options()).scenario == before.scenario


def test_another_word_is_refused() -> None:
    with pytest.raises(InputError, match=r"--physics jsb: allowed: .*own.*jsbsim"):
        prepare("antipodal-8", Options(physics="jsb"))


@pytest.mark.parametrize("setting", ["turbulence_by: jsbsim", "atmosphere: isa"])
def test_weather_that_only_jsbsim_makes_is_refused_by_ours(setting: str, tmp_path: Path) -> None:
    file = tmp_path / "windy.yaml"
    file.write_text(f"{ANTIPODAL}\nweather: {{turbulence: light, {setting}}}\n")
    with pytest.raises(InputError, match=f"weather.{setting} needs physics: jsbsim; it is 'own'"):
        prepare(str(file), Options())


def test_without_the_package_it_says_how_to_get_it(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "jsbsim", None)
    ended = run("swarm", "antipodal-8", "--physics", "jsbsim", "--out", str(tmp_path / "out"))
    assert ended.status == 3
    assert ended.out == ""
    assert ended.err.count("\n") == 1
    assert "needs jsbsim" in ended.err
    assert "pip install '.[sitl]'" in ended.err
    assert not (tmp_path / "out").exists()
