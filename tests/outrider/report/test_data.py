"""What the page shows is what the flight was: clocks, thinning, packing."""

from __future__ import annotations

import contextlib
import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from outrider.errors import InputError
from outrider.report import arrays as files
from outrider.report import clocks, thinning
from outrider.report.command import make
from outrider.report.reading import read
from outrider.report.replay import Packed, pack, unpack
from tests.outrider.report.runs import leave
from tests.outrider.shipped import scenario

NUMBERS = st.floats(-1e6, 1e6) | st.just(float("nan"))


@given(arrays(np.float64, array_shapes(max_dims=3, max_side=6), elements=NUMBERS))
def test_packed_is_within_half_a_quantum(values: np.ndarray) -> None:
    packed = pack(values, 1e-3)
    assert packed.kind in ("i2", "i4")
    np.testing.assert_allclose(unpack(packed), values, rtol=0.0, atol=0.5001e-3, equal_nan=True)
    assert packed.shape == values.shape


def test_what_no_integer_holds_is_nothing() -> None:
    assert np.isnan(unpack(pack(np.array([np.inf, 1e9, np.nan]), 1e-3))).all()


def embedded(page: str) -> dict[str, object]:
    """The document in a page."""
    (text,) = page.split('<script type="application/json" id="run">')[1:]
    found: dict[str, object] = json.loads(text.partition("</script>")[0])
    return found


def test_the_page_holds_the_flight(tmp_path: Path) -> None:
    made = leave(tmp_path, vehicles=3)
    document = embedded(make(made.directory).text)
    motions = read(made.directory).motions
    assert motions is not None
    shown = thinning.chosen(motions)
    assert np.diff(motions.time[shown]) == pytest.approx(0.04)

    def values(name: str) -> np.ndarray:
        return unpack(Packed(**document[name]))  # type: ignore[arg-type]

    for name, quantum in {
        "time": 1e-4,
        "position": 1e-3,
        "velocity": 1e-3,
        "reference": 1e-3,
        "yaw": 1e-4,
        "tilt": 1e-4,
        "target": 1e-3,
    }.items():
        true = getattr(motions, name)[shown]
        np.testing.assert_allclose(values(name), true, rtol=0.0, atol=0.5001 * quantum)
    assert document["systems"] == [11, 12, 13]
    assert (document["from"], document["to"]) == (-1.0, 10.0)


def test_charts_hold_what_they_say(tmp_path: Path) -> None:
    document = embedded(make(leave(tmp_path, vehicles=3).directory).text)
    charts = {chart["key"]: chart for chart in document["charts"]}  # type: ignore[attr-defined]
    assert set(charts) == {"separation", "place", "yaw", "tracking", "gradient", "speed", "loss"}
    tracking = unpack(Packed(**charts["tracking"]["values"]))
    assert tracking == pytest.approx(0.01 * 3**0.5, abs=1e-5)
    gradient = unpack(Packed(**charts["gradient"]["values"]))
    assert np.nanmax(gradient) == np.nanmin(gradient) == pytest.approx(0.5 * 3**0.5, rel=1e-4)
    assert [level["name"] for level in charts["separation"]["levels"]] == ["tip to tip", "d_min"]
    spent = document["spent"]
    assert isinstance(spent, dict)
    assert sum(spent["counts"]) == spent["plans"] == 3000
    assert spent["p50"] == pytest.approx(0.3, abs=1e-3)


def test_the_largest_in_between_is_kept() -> None:
    shown = np.array([0.0, 1.0, 2.0, 3.0])
    found = thinning.largest(np.array([0.2, 0.7, 1.0, 2.5, 9.0]), np.array([1.0, 5.0, 2.0, 7.0, 99.0]), shown)
    np.testing.assert_array_equal(found, [np.nan, 5.0, np.nan, 7.0])


def test_a_large_fleet_is_thinned_more(tmp_path: Path) -> None:
    motions = read(leave(tmp_path, vehicles=1, logs=False).directory).motions
    assert motions is not None
    time = 0.02 * np.arange(30_000)
    long = motions._replace(time=time, system=tuple(range(11, 19)))
    assert len(thinning.chosen(long)) * 8 <= thinning.MOST + 8
    assert thinning.chosen(long)[-1] == 29_999


@pytest.mark.parametrize("late", [0, 4_200_000, -2_500_000])
def test_a_log_finds_its_time(late: int, tmp_path: Path) -> None:
    run = read(leave(tmp_path, vehicles=2, late={12: late}).directory)
    assert run.motions is not None
    offsets = {log.owner: clocks.offset(log, run.motions) for log in run.logs}
    assert offsets[12] == pytest.approx(-3.0, abs=0.02)
    ahead = clocks.errors(run.logs, offsets)
    assert ahead[12] - ahead[11] == pytest.approx(1e-6 * late, abs=0.02)


def test_a_log_that_begins_later_finds_its_time(tmp_path: Path) -> None:
    run = read(leave(tmp_path, vehicles=2).directory)
    assert run.motions is not None
    log = run.logs[0]
    cut = log._replace(begin=log.begin + 1_300_000)
    assert clocks.offset(cut, run.motions) == pytest.approx(-1.7, abs=0.02)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"time_s": np.zeros(651)}, "time_s does not rise"),
        ({"yaw": np.zeros((651, 2))}, "yaw is of shape (651, 2); needed: (651, 3)"),
        ({"target": np.zeros((650, 3))}, "target is of shape"),
        ({"tilt": None}, "holds no tilt"),
        ({"position": np.full((651, 3, 3), "x")}, "position holds neither"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(
    change: dict[str, np.ndarray | None], said: str, tmp_path: Path
) -> None:
    path = leave(tmp_path, logs=False).directory / "flight.npz"
    with np.load(path) as file:
        values = {name: file[name] for name in file} | change
    np.savez(path, **{name: value for name, value in values.items() if value is not None})
    with pytest.raises(InputError) as caught:
        files.motions(path)
    assert said in str(caught.value)


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, bytes]:
    """A place for a file, and what it should hold."""
    folder = tmp_path_factory.mktemp("damaged")
    made = leave(folder, vehicles=1, seconds=0.5, logs=False)
    return folder / "damaged.npz", (made.directory / "flight.npz").read_bytes()


@given(place=st.integers(0, 10_000), byte=st.integers(0, 255))
def test_a_damaged_file_is_read_or_refused(place: int, byte: int, sound: tuple[Path, bytes]) -> None:
    path, good = sound
    data = bytearray(good)
    data[place % len(data)] = byte
    path.write_bytes(data)
    with contextlib.suppress(InputError):
        assert len(files.motions(path).time)


def test_boxes_and_walls_are_in_the_page_where_they_stand(tmp_path: Path) -> None:
    obstacles = [
        {"kind": "box", "at": [4.0, -1.0, 2.0], "size": [2.0, 1.0, 3.0], "yaw_deg": 90.0},
        {"kind": "wall", "ends": [[-3.0, 0.0], [1.0, 0.0]], "thickness": 0.5, "height": 4.0},
        {"kind": "post", "at": [0.0, 8.0], "radius": 0.5, "height": 6.0},
    ]
    of = scenario("antipodal-8", vehicles=3, obstacles=obstacles)
    page = make(leave(tmp_path / "run", scenario=of).directory).text
    assert embedded(page)["scene"]["fixed"] == [  # type: ignore[index]
        {"kind": "box", "at": [4.0, -1.0, 2.0], "size": [2.0, 1.0, 3.0], "yaw": 1.570796},
        {"kind": "box", "at": [-1.0, 0.0, 2.0], "size": [4.0, 0.5, 4.0], "yaw": 0.0},
        {"kind": "post", "at": [0.0, 8.0, 0.0], "radius": 0.5, "height": 6.0},
    ]
