"""Keys, and the files that hold them."""

from __future__ import annotations

import errno
import hashlib
import os
import stat
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_bridge.errors import KeyFileError
from mavlink_bridge.key import Key, create_key, read_key
from mavlink_bridge.messages import SetupSigning, Source

secrets = st.binary(min_size=32, max_size=32)


def kept(path: Path, data: bytes, mode: int = 0o600) -> Path:
    path.write_bytes(data)
    path.chmod(mode)
    return path


@given(secrets.filter(any))
def test_a_key_in_digits_is_read_back(tmp_path_factory: pytest.TempPathFactory, secret: bytes) -> None:
    path = kept(tmp_path_factory.mktemp("keys") / "one", secret.hex().encode() + b"\n")
    assert bytes(read_key(path)) == secret


@pytest.mark.parametrize("end", ["", "\n", "\r\n"])
@pytest.mark.parametrize("text", ["correct horse", "ÄÖÜ über alles", "abc123", " spaces count "])
def test_any_other_line_is_a_passphrase_as_ground_stations_hash_it(
    tmp_path: Path, text: str, end: str
) -> None:
    path = kept(tmp_path / "key", (text + end).encode())
    assert bytes(read_key(path)) == hashlib.sha256(text.encode()).digest()
    assert read_key(path) == Key.of_passphrase(text)


def test_a_new_key_is_its_owners_alone_and_like_no_other(tmp_path: Path) -> None:
    mask = os.umask(0)
    try:
        paths = [tmp_path / str(number) for number in range(20)]
        keys = {create_key(path) for path in paths}
    finally:
        os.umask(mask)
    assert len(keys) == len({key.fingerprint for key in keys}) == 20
    for path in paths:
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
        assert read_key(path) in keys
        # To be typed anywhere, and not to be taken for digits.
        assert set(path.read_text().strip()) <= set("abcdefghijklmnopqrstuvwxyz234567-")


def test_a_key_is_not_overwritten(tmp_path: Path) -> None:
    key = create_key(tmp_path / "key")
    with pytest.raises(KeyFileError, match="is there already"):
        create_key(tmp_path / "key")
    assert read_key(tmp_path / "key") == key


@pytest.mark.skipif(os.name != "posix", reason="files have no such modes here")
@pytest.mark.parametrize("mode", [0o640, 0o604, 0o620, 0o644, 0o610])
def test_a_file_that_others_may_use_is_refused_with_what_to_do(tmp_path: Path, mode: int) -> None:
    path = kept(tmp_path / "key", b"correct horse\n", mode)
    with pytest.raises(KeyFileError) as caught:
        read_key(path)
    said = str(caught.value)
    assert f"mode {mode:03o}" in said
    assert said.endswith(f"chmod 600 {path}")
    assert "horse" not in said


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"", "holds no key"),
        (b"\n", "holds no key"),
        (b"one\ntwo\n", "holds no key"),
        (b"a\0b", "holds no key"),
        (b"\xff\xfe\n", "not text"),
        (b"0" * 64, "nothing but zeros"),
        (b"ab" * 31, "62 hexadecimal digits"),
        (b"ab" * 33, "66 hexadecimal digits"),
        (b"x" * 2000, "more than 1024 bytes"),
    ],
)
def test_what_is_no_key_is_said_in_one_line_that_tells_no_secret(
    tmp_path: Path, data: bytes, said: str
) -> None:
    path = kept(tmp_path / "key", data)
    with pytest.raises(KeyFileError) as caught:
        read_key(path)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)


def test_what_is_no_file_is_refused_and_never_waited_for(tmp_path: Path) -> None:
    with pytest.raises(KeyFileError, match="No such file"):
        read_key(tmp_path / "none")
    with pytest.raises(KeyFileError):
        read_key(tmp_path)
    os.mkfifo(tmp_path / "pipe", 0o600)
    with pytest.raises(KeyFileError, match="is not a file"):
        read_key(tmp_path / "pipe")
    with pytest.raises(KeyFileError, match="cannot be written"):
        create_key(tmp_path / "no" / "folder")


@given(secrets)
def test_nothing_that_is_printed_shows_the_secret(secret: bytes) -> None:
    key = Key(secret)
    for text in (repr(key), str(key), f"{key}", repr(SetupSigning(Source(255, 190), 1, 11, 1, key))):
        assert secret.hex() not in text
        assert repr(secret) not in text
    assert key.fingerprint in repr(key)


@given(secrets, secrets)
def test_keys_are_equal_if_their_bytes_are(one: bytes, other: bytes) -> None:
    assert (Key(one) == Key(other)) == (one == other)
    assert Key(one) == Key(one)
    assert hash(Key(one)) == hash(Key(one))
    assert Key(one) != one
    assert Key(one).blank == (not any(one))


@pytest.mark.parametrize("length", [0, 31, 33])
def test_a_key_has_32_bytes(length: int) -> None:
    with pytest.raises(ValueError, match="32 bytes"):
        Key(bytes(length))


def test_a_key_that_could_not_be_written_leaves_no_file(tmp_path, monkeypatch):
    def full(_number: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    path = tmp_path / "fleet.key"
    with pytest.raises(KeyFileError, match="No space left on device"):
        create_key(path)
    assert not path.exists()
