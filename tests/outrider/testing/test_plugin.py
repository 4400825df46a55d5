"""The pytest plugin as its users have it: fixtures, assertions that say what is wrong, golden files."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_bridge.messages import SetpointLocal, Source
from outrider.testing.golden import Golden, difference, packed, unpacked
from outrider.testing.setpoints import Setpoints

EXAMPLE = Path(__file__).resolve().parents[3] / "docs" / "testing.md"
OPTIONS = ("-p", "no:cacheprovider", "-p", "no:xdist", "-Werror")
FLIGHT = """
def test_flight(fly):
    flown = fly("antipodal-8", vehicles=2, cap_s=3.0, airborne=True, companion=CHANGE)
    flown.setpoints().assert_golden("two", within=0.01)
"""


def row(times: np.ndarray, seed: int = 0) -> list[tuple[int, SetpointLocal]]:
    """A smooth course of set-points at these times (µs)."""
    s = (times - times[0]) * 1e-6
    phase = np.random.default_rng(seed).uniform(0.0, 6.0)
    north, east = np.sin(s + phase), np.cos(s + phase)
    zero = (0.0, 0.0, 0.0)
    return [
        (
            int(time),
            SetpointLocal(Source(11, 195), 0, 11, 1, 1, 0, (n, e, -5.0), (e, -n, 0.0), zero, 0.1, 0.0),
        )
        for time, n, e in zip(times, north.tolist(), east.tolist(), strict=True)
    ]


def every(period: int = 20_000, count: int = 300) -> np.ndarray:
    return 1_767_225_600_000_000 + period * np.arange(count, dtype=np.int64)


def setpoints(told: list[tuple[int, SetpointLocal]], folder: Path, *, update: bool = False) -> Setpoints:
    return Setpoints("vehicle 11", told, Golden(folder, update=update))


def changed(
    told: list[tuple[int, SetpointLocal]], k: int, **fields: object
) -> list[tuple[int, SetpointLocal]]:
    return [(t, m._replace(**fields) if j == k else m) for j, (t, m) in enumerate(told)]


def test_a_sound_course_passes_all(tmp_path: Path) -> None:
    of = setpoints(row(every()), tmp_path)
    of.assert_continuous(step=0.03, speed=1.01, acceleration=0.1)
    of.assert_rate(at_least=50, gap=0.03)
    setpoints(row(every()), tmp_path, update=True).assert_golden("course")
    of.assert_golden("course")


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"position": (9.0, 0.0, -5.0)}, "m from one position to the next, 2.00 s after"),
        ({"velocity": (0.0, 7.0, 0.0)}, r"7\.000 m/s, 2\.00 s after"),
        ({"acceleration": (0.0, 0.0, 9.0)}, r"9\.000 m/s², 2\.00 s after"),
        ({"yaw": float("nan")}, r"not finite, 2\.00 s after"),
    ],
)
def test_what_jumps_is_named_with_its_time(fields: dict[str, object], said: str, tmp_path: Path) -> None:
    of = setpoints(changed(row(every()), 100, **fields), tmp_path)
    with pytest.raises(AssertionError, match=said):
        of.assert_continuous(step=0.3, speed=5.0, acceleration=5.0)


def test_what_the_mask_ignores_may_be_anything(tmp_path: Path) -> None:
    nothing = (float("nan"),) * 3
    told = [(t, m._replace(type_mask=0x1C0, acceleration=nothing)) for t, m in row(every())]
    setpoints(told, tmp_path).assert_continuous(acceleration=1.0)


def test_a_pause_and_a_slow_second_are_found(tmp_path: Path) -> None:
    told = row(every())
    with pytest.raises(AssertionError, match=r"no set-point for 1\.02 s, from 0\.98 s after"):
        setpoints(told[:50] + told[100:], tmp_path).assert_rate(at_least=10)
    with pytest.raises(AssertionError, match="25 set-points in the second that begins 0 s"):
        setpoints(row(every(40_000)), tmp_path).assert_rate(at_least=40)


@given(st.integers(0, 299), st.sampled_from([0, 1, 2]), st.floats(0.05, 50.0), st.booleans())
def test_the_first_and_the_worst_difference_are_told(k: int, axis: int, off: float, up: bool) -> None:
    from outrider.testing.golden import table

    golden = table(setpoints(row(every()), Path()).course)
    found = golden.copy()
    found[k, 1 + axis] += off if up else -off
    said = difference(golden, found, 0.01)
    assert f"{found[k, 0] * 1e-3:.2f} s after the first: {('north', 'east', 'down')[axis]}" in said
    assert "1 of 300 differ" in said
    assert f"{off:.4f} m apart" in said
    assert difference(golden, found, 51.0) == ""
    assert difference(golden, golden, 0.0) == ""


def test_a_turn_over_the_end_of_angles_is_none() -> None:
    golden = np.zeros((1, 13))
    found = golden.copy()
    golden[0, 10], found[0, 10] = 3.141, -3.141
    assert difference(golden, found, 0.01) == ""


def test_other_times_and_another_count_are_told() -> None:
    golden = np.zeros((5, 13))
    golden[:, 0] = 20.0 * np.arange(5)
    assert "there are 4 set-points, the golden file has 5" in difference(golden, golden[:4], 0.01)
    later = golden.copy()
    later[2:, 0] += 20.0
    assert "3th set-point comes 0.060 s after" in difference(golden, later, 0.01)


@pytest.mark.parametrize("fields", [{"frame": 7}, {"type_mask": 0x1C0}, {"acceleration": (9.0, 9.0, 9.0)}])
def test_so_are_another_frame_mask_and_acceleration(fields: dict[str, object], tmp_path: Path) -> None:
    setpoints(row(every()), tmp_path, update=True).assert_golden("course")
    of = setpoints(changed(row(every()), 100, **fields), tmp_path)
    with pytest.raises(AssertionError, match=r"part 2\.00 s after the first"):
        of.assert_golden("course")


def test_nothing_is_no_flight(tmp_path: Path) -> None:
    with pytest.raises(AssertionError, match="no set-points"):
        setpoints([], tmp_path, update=True).assert_golden("course")
    with pytest.raises(AssertionError, match=r"3\.0 set-points a second|2\.5 set-points a second"):
        setpoints(row(every(400_000, 3)), tmp_path).assert_rate(at_least=45)
    for within in (0.0, -1.0, float("nan")):
        with pytest.raises(ValueError, match="within"):
            setpoints(row(every()), tmp_path).assert_golden("course", within=within)


def test_a_golden_file_comes_back_as_it_was(tmp_path: Path) -> None:
    values = np.round(np.random.default_rng(1).normal(size=(40, 13)), 4)
    values[:, 0] = np.arange(40)
    values[3, 4] = np.nan
    (tmp_path / "file").write_bytes(packed(values))
    np.testing.assert_array_equal(unpacked(tmp_path / "file"), values)
    assert packed(values) == packed(unpacked(tmp_path / "file"))


@given(st.binary(max_size=80))
def test_a_damaged_golden_file_is_an_assertion_in_words(data: bytes) -> None:
    from tempfile import TemporaryDirectory

    with TemporaryDirectory() as folder:
        path = Path(folder) / "x.csv.gz"
        path.write_bytes(data)
        with pytest.raises(AssertionError, match="is no golden file"):
            unpacked(path)


@pytest.mark.slow
def test_another_gain_fails_the_golden_test_in_words(pytester: pytest.Pytester) -> None:
    """Made by a flag, it passes; with one gain changed it says where the set-points part, and by how much."""
    pytester.makepyfile(test_it=FLIGHT.replace("CHANGE", "{}"))
    missing = pytester.runpytest_subprocess(*OPTIONS)
    missing.assert_outcomes(failed=1)
    missing.stdout.fnmatch_lines(["*there is no such golden file; pytest --update-golden makes it*"])
    pytester.runpytest_subprocess(*OPTIONS, "--update-golden").assert_outcomes(passed=1)
    assert (pytester.path / "golden" / "two.csv.gz").exists()
    pytester.runpytest_subprocess(*OPTIONS).assert_outcomes(passed=1)
    pytester.makepyfile(test_it=FLIGHT.replace("CHANGE", '{"cost": {"omega_i": 2.0}}'))
    failed = pytester.runpytest_subprocess(*OPTIONS)
    failed.assert_outcomes(failed=1)
    said = "\n".join(line for line in failed.outlines if line.startswith("E "))
    where = re.search(r"the set-points part (\d+\.\d\d) s after the first: (\w+)", said)
    assert where is not None, said
    assert re.search(r"\d+ of \d+ differ, most \d+\.\d\d s after", said)


@pytest.mark.slow
def test_the_example_in_the_docs_works(pytester: pytest.Pytester) -> None:
    """As it stands there, with a log to listen to."""
    text = EXAMPLE.read_text(encoding="utf-8")
    code = "\n".join(re.findall(r"```python\n(.*?)```", text, re.DOTALL))
    assert "def test_" in code
    pytester.makepyfile(test_example=code)
    log = EXAMPLE.parents[1] / "tests" / "data" / "logs" / "copter-whole.tlog"
    (pytester.path / "flight.tlog").write_bytes(log.read_bytes())
    pytester.runpytest_subprocess(*OPTIONS, "--update-golden").assert_outcomes(passed=code.count("def test_"))
    pytester.runpytest_subprocess(*OPTIONS).assert_outcomes(passed=code.count("def test_"))


def test_a_change_that_makes_no_sense_is_named(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        test_it="""
        import pytest
        from outrider.errors import InputError

        def test_flight(fly):
            with pytest.raises(InputError, match="vehicles"):
                fly("antipodal-8", vehicles=0)
            with pytest.raises(InputError, match="speeed"):
                fly("antipodal-8", companion={"speeed": 1})
            with pytest.raises(InputError, match="antipodal-8"):
                fly("antipodel-8")
        """
    )
    pytester.runpytest_subprocess(*OPTIONS).assert_outcomes(passed=1)
