"""Orders that come by standard input: each arrives once and in order, however fast they come."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from outrider.onboard.line_input import FEW, LineInput


@pytest.fixture
def pipe() -> Iterator[tuple[int, int]]:
    """Where to read, and where to write without waiting."""
    near, far = os.pipe()
    os.set_blocking(far, False)
    yield near, far
    os.close(near)
    os.close(far)


def test_who_never_stops_writing_takes_nobodys_time(pipe: tuple[int, int]) -> None:
    near, far = pipe
    typed, written, found = LineInput(near), 0, 0
    for _ in range(300):
        try:
            while True:
                os.write(far, b"%d\n" % written)
                written += 1
        except BlockingIOError:
            # There is more than can be taken in.
            pass
        lines = typed.lines()
        assert len(lines) <= FEW
        # None is lost, and none comes before another.
        assert lines == [str(k) for k in range(found, found + len(lines))]
        found += len(lines)
    assert found > 1000


def test_a_line_that_never_ends_takes_nobodys_time_either(pipe: tuple[int, int]) -> None:
    near, far = pipe
    typed = LineInput(near)
    os.write(far, b"x" * 20_000 + b"\nland\n")
    looks = [typed.lines() for _ in range(30)]
    assert looks[0] == []
    assert [line[-4:] for lines in looks for line in lines] == ["xxxx", "land"]


def test_a_named_pipe_hears_who_writes_after_another_has_gone(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "orders")
    # Open before anybody writes, as no shell waits in a test.
    near = os.open(tmp_path / "orders", os.O_RDONLY | os.O_NONBLOCK)
    typed = LineInput(near)
    for text in ("go\n", "hold\nret", "land\n"):
        (tmp_path / "orders").write_text(text)
        assert typed.lines() == text.split("\n")[:-1]
        # Nobody has it open now: a line that was not finished is no beginning of another's.
        assert typed.lines() == []
        assert typed.pending == ""
    os.close(near)
