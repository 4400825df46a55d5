"""``outrider key``."""

from __future__ import annotations

from pathlib import Path

import pytest

from mavlink_bridge.key import read_key
from outrider.errors import InputError
from outrider.key_files import key_of
from tests.outrider.said import Run


def test_a_key_is_made_once_and_never_shown(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "fleet.key"
    ended = run("key", str(path))
    assert (ended.status, ended.err) == (0, "")
    key = read_key(path)
    assert ended.out.startswith(f"{path}: ")
    assert ended.out.endswith(f" {key.fingerprint}\n")
    assert path.read_text().strip() not in ended.out
    again = run("key", str(path))
    assert (again.status, again.out) == (2, "")
    assert again.err == f"{path}: is there already; a key is not overwritten\n"
    assert read_key(path) == key == key_of(path)


def test_a_key_that_cannot_be_read_is_bad_input(tmp_path: Path) -> None:
    path = tmp_path / "open.key"
    path.write_text("correct horse\n")
    path.chmod(0o644)
    with pytest.raises(InputError, match="chmod 600"):
        key_of(path)
