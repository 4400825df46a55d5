"""A flight from Python is that of the command line; its arrays, page and table agree with its summary."""

from __future__ import annotations

import gc
from pathlib import Path

import numpy as np
import pytest

import outrider
from outrider import Flight, InputError


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Flight:
    short = {"cap_s": 1.0, "airborne": True, "companion": {"rates": {"replan_us": 50_000}}}
    return outrider.fly("antipodal-8", 2, vehicles=3, out=tmp_path_factory.mktemp("run") / "one", **short)


def test_the_arrays_agree_with_the_summary(flight: Flight) -> None:
    assert flight.systems == (11, 12, 13)
    assert flight.positions.shape == (len(flight.times), 3, 3)
    assert flight.separation.min() == pytest.approx(flight.summary["min_separation_m"], abs=1e-3)
    assert flight.seed == 2
    assert flight.scenario.vehicles == 3
    moved = np.diff(flight.positions[:, 0], axis=0) / np.diff(flight.times)[:, None]
    np.testing.assert_allclose(moved, 0.5 * (flight.velocities[1:, 0] + flight.velocities[:-1, 0]), atol=0.05)


def test_the_table_has_the_arrays(flight: Flight) -> None:
    table = flight.to_pandas()
    one = table[table.system == 12]
    np.testing.assert_array_equal(one[["east_m", "north_m", "up_m"]].to_numpy(), flight.positions[:, 1])
    np.testing.assert_array_equal(one.time_s.to_numpy(), flight.times)


def test_the_page_is_the_report(flight: Flight, tmp_path: Path) -> None:
    page = flight.to_html(tmp_path / "mine.html")
    assert "antipodal-8" in page.read_text(encoding="utf-8")
    assert "<iframe" in flight._repr_html_()
    assert flight.to_html().parent == flight.directory
    (tmp_path / "letter.html").write_text("dear reader")
    with pytest.raises(InputError):
        flight.to_html(tmp_path / "letter.html")


def test_a_run_directory_is_a_flight(flight: Flight, tmp_path: Path) -> None:
    again = Flight(flight.save(tmp_path / "copy"))
    assert np.array_equal(again.positions, flight.positions)
    assert "3 vehicles" in repr(again)
    with pytest.raises(InputError, match="no such directory"):
        Flight(tmp_path / "nothing")


def test_files_in_a_temporary_place_go_with_the_flight() -> None:
    short = {"cap_s": 0.2, "airborne": True, "companion": {"rates": {"replan_us": 100_000}}}
    flight = outrider.fly("antipodal-8", vehicles=2, **short)
    place = flight.directory
    assert place.is_dir()
    del flight
    gc.collect()
    assert not place.exists()


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"vehicels": 4}, "did you mean 'vehicles'?"),
        ({"companion": {"methods": ["tangental"]}}, "did you mean 'tangential'?"),
        ({"companion": {"field": {"d_mn": 1.0}}}, "did you mean 'd_min'?"),
        ({"companion": {"field": {"d_min": "near"}}}, "companion.field.d_min is"),
        ({"seed": -1}, "seed: is -1"),
        ({"sensors": object()}, "changes: "),
    ],
)
def test_wrong_changes_name_the_key_and_the_nearest_word(changes: dict[str, object], said: str) -> None:
    with pytest.raises(InputError) as error:
        outrider.fly("antipodal-8", **changes)  # type: ignore[arg-type]
    assert said in str(error.value)


def test_certified_changes_the_turning_sense_as_the_command_line_does() -> None:
    own = outrider.scenario("scenario-1", companion={"turning_sense": "own"})
    assert own.companion.turning_sense == "own"
    changes = {"avoidance": "certified", "turning_sense": None}
    assert (
        outrider.scenario("obstacles", companion={"avoidance": "certified"}).companion.turning_sense != "own"
    )
    with pytest.raises(InputError):
        outrider.scenario("scenario-1", companion=changes)
