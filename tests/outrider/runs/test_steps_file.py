"""When a companion was stepped: what is written is what is read, and a day of it is small."""

from __future__ import annotations

from pathlib import Path
from sys import getsizeof
from tempfile import TemporaryDirectory

from hypothesis import given
from hypothesis import strategies as st

from outrider.runs.steps_file import StepsFile, read_steps

GAPS = st.lists(st.tuples(st.sampled_from([4, 20_000, 20_004, 3_000_000]), st.integers(1, 30)), max_size=20)


@given(first=st.integers(0, 1 << 52), gaps=GAPS)
def test_what_is_written_is_read(first: int, gaps: list[tuple[int, int]]) -> None:
    times = [first]
    for gap, count in gaps:
        for _ in range(count):
            times.append(times[-1] + gap)
    with TemporaryDirectory() as directory:
        file = StepsFile(Path(directory) / "steps.npz")
        for time in times:
            file.add(time)
        file.close()
        assert read_steps(Path(directory) / "steps.npz").tolist() == times


def test_no_steps_are_none(tmp_path: Path) -> None:
    StepsFile(tmp_path / "steps.npz").close()
    assert read_steps(tmp_path / "steps.npz").tolist() == []


def test_what_it_holds_does_not_grow_with_the_steps(tmp_path: Path) -> None:
    file = StepsFile(tmp_path / "steps.npz")
    sizes = []
    for step in range(100_000):
        file.add(20_000 * step)
        if step in (100, 99_999):
            sizes.append(sum(getsizeof(part) for part in vars(file).values()))
    assert sizes[1] < sizes[0] + 64
