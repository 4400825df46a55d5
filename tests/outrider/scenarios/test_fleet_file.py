"""Fleet files: read as they were written, refused when they were changed, and never silently overruled."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from companion.config import CompanionConfig
from outrider.errors import InputError
from outrider.resources import find
from outrider.scenarios.fleet_file import (
    FleetFile,
    Measurement,
    fingerprint_of,
    settings_of,
    text_of,
    with_fleet_file,
)
from outrider.scenarios.fly_config import FleetOrigin, FlyConfig
from outrider.yaml_files.yaml_file import load, read

ORIGIN = FleetOrigin(latitude=47.397742, longitude=8.545594, altitude=488.0)
MEASURED = Measurement(at="2026-11-24T12:00:00Z", seconds=20.0, configured=("tube",), vehicles=(), links=())


def made(fleet: tuple[int, ...] = (1, 2, 3), **certified: Any) -> FleetFile:
    config = CompanionConfig.model_validate({"certified": {"fleet": fleet, **certified}})
    return settings_of(config, ORIGIN, MEASURED)


def companion_file(folder: Path, companion: dict[str, Any] | None = None, **changes: Any) -> Path:
    """A companion file beside ``fleet.yaml``, which it names."""
    document: dict[str, Any] = {
        "system": 1,
        "target": 100,
        "origin": ORIGIN.model_dump(),
        "fleet": "fleet.yaml",
        "companion": companion or {},
        **changes,
    }
    path = folder / "own.yaml"
    path.write_text(yaml.safe_dump(document), encoding="utf-8")
    return path


def loaded(path: Path) -> FlyConfig:
    return with_fleet_file(load(path, FlyConfig), path)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "fleet.yaml").write_text(text_of(made(tube=0.6, clock_us=20_000)), encoding="utf-8")
    return tmp_path


sigmas, tubes = st.floats(0.0, 5.0), st.floats(0.001, 100.0)


@given(
    st.sets(st.integers(1, 250), min_size=2).map(tuple),
    tubes,
    st.integers(0, 99_999),
    sigmas,
    st.floats(-89.0, 89.0),
    st.floats(0.01, 30.0),
    st.none() | st.floats(0.0, 0.9),
)
def test_it_is_read_as_it_was_written(
    fleet: tuple[int, ...],
    tube: float,
    clock: int,
    sigma: float,
    latitude: float,
    speed: float,
    shift: float | None,
) -> None:
    config = CompanionConfig.model_validate(
        {
            "certified": {"fleet": fleet, "tube": tube, "clock_us": clock, "plane_shift": shift},
            "field": {"position_sigma": sigma},
            "limits": {"v_max": (speed, speed, speed)},
            "tangential": {"d_band": 10.0},
        }
    )
    written = settings_of(config, ORIGIN.model_copy(update={"latitude": latitude}), MEASURED)
    text = text_of(written)
    assert read(text.encode(), "fleet.yaml", FleetFile) == written
    assert text_of(read(text.encode(), "fleet.yaml", FleetFile)) == text


def test_the_shift_of_planes_is_the_same_for_all(tmp_path: Path) -> None:
    (tmp_path / "fleet.yaml").write_text(text_of(made(plane_shift=0.5)), encoding="utf-8")
    assert loaded(companion_file(tmp_path)).companion.plane_shift == 0.5
    with pytest.raises(InputError, match=r"certified\.plane_shift: is 0\.25, and 0\.5 in"):
        loaded(companion_file(tmp_path, {"certified": {"plane_shift": 0.25}}))


TEXT = text_of(made())


@given(st.integers(0, len(TEXT) - 1), st.sampled_from("0123456789abcdef.-: []{},'#\n\ttrue\x00é"))
def test_one_changed_character_is_refused_or_changes_nothing_that_is_common(at: int, letter: str) -> None:
    damaged = TEXT[:at] + letter + TEXT[at + 1 :]
    try:
        file = read(damaged.encode(), "fleet.yaml", FleetFile)
    except InputError:
        return
    assert file.model_copy(update={"measured": MEASURED, "distance": 0.0}) == made().model_copy(
        update={"distance": 0.0}
    )


@given(st.binary(max_size=400) | st.text(max_size=400).map(lambda text: text.encode("utf-8", "replace")))
def test_other_bytes_are_refused_with_their_faults(data: bytes) -> None:
    with pytest.raises(InputError, match=r"fleet\.yaml"):
        read(data, "fleet.yaml", FleetFile)


values = (
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8) | st.lists(st.integers())
)


@given(st.sampled_from(sorted(FleetFile.model_fields)), values)
def test_another_value_of_a_key_is_refused_or_is_the_same(name: str, value: object) -> None:
    document = {**made().model_dump(mode="json"), name: value}
    try:
        file = read(yaml.safe_dump(document).encode(), "fleet.yaml", FleetFile)
    except InputError:
        return
    assert file.fingerprint == made().fingerprint


def test_a_companion_file_takes_what_it_leaves_out(folder: Path) -> None:
    config = loaded(companion_file(folder, {"limits": {"u_max": [1.0, 1.0, 1.0]}}))
    assert (config.companion.certified.tube, config.companion.certified.clock_us) == (0.6, 20_000)
    assert config.companion.certified.fleet == (1, 2, 3)
    assert config.companion.limits.u_max == (1.0, 1.0, 1.0)
    assert (
        fingerprint_of(config.companion, config.origin) == load(folder / "fleet.yaml", FleetFile).fingerprint
    )


def test_what_both_files_state_alike_is_no_conflict(folder: Path) -> None:
    config = loaded(companion_file(folder, {"certified": {"tube": 0.6, "fleet": [3, 2, 1]}}))
    assert config.companion.certified.tube == 0.6


CONFLICTS: dict[str, tuple[dict[str, Any], str]] = {
    "tube": (
        {"companion": {"certified": {"tube": 0.25}}},
        r"companion\.certified\.tube: is 0\.25, and 0\.6 in",
    ),
    "d_min": ({"companion": {"field": {"d_min": 0.9}}}, r"companion\.field\.d_min: is 0\.9, and 0\.5 in"),
    "fleet": (
        {"companion": {"certified": {"fleet": [1, 2]}}},
        r"companion\.certified\.fleet: is \[1, 2\], and \[1, 2, 3\] in",
    ),
    "origin": ({"origin": {**ORIGIN.model_dump(), "altitude": 489.0}}, "origin: is not that of"),
    "own id": ({"system": 7}, "roster: 1, 2, 3 lacks the own system id 7"),
    "no file": ({"fleet": "elsewhere.yaml"}, "elsewhere.yaml: there is no such file"),
}


@pytest.mark.parametrize("name", CONFLICTS)
def test_a_conflict_names_both_values_and_both_files(name: str, folder: Path) -> None:
    changes, words = CONFLICTS[name]
    path = companion_file(folder, **changes)
    with pytest.raises(InputError, match=words) as caught:
        loaded(path)
    assert str(folder) in str(caught.value)


def test_all_conflicts_are_told_at_once(folder: Path) -> None:
    path = companion_file(folder, {"certified": {"tube": 0.25, "sigmas": 2.0}, "planar": True}, system=9)
    with pytest.raises(InputError) as caught:
        loaded(path)
    assert len(str(caught.value).splitlines()) == 4


def test_a_companion_that_cannot_have_the_settings_is_refused(folder: Path) -> None:
    """The field of this companion ends where d_min of the fleet begins."""
    wide = CompanionConfig.model_validate({"certified": {"fleet": [1, 2]}, "field": {"d_min": 2.0}})
    (folder / "fleet.yaml").write_text(text_of(settings_of(wide, ORIGIN, MEASURED)), encoding="utf-8")
    path = companion_file(folder, {"field": {"d_safe": 1.5}})
    with pytest.raises(InputError, match="d_safe must be larger than d_min"):
        loaded(path)


def test_a_file_whose_settings_were_changed_by_hand_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "fleet.yaml"
    path.write_text(text_of(made()).replace("tube: 0.25", "tube: 0.2"), encoding="utf-8")
    with pytest.raises(InputError, match="was changed after it was measured"):
        load(path, FleetFile)


def test_without_a_fleet_file_nothing_changes() -> None:
    path = find("companions", "px4")
    config = load(path, FlyConfig)
    assert with_fleet_file(config, path) is config
