"""The secret that signs MAVLink frames, and the file that holds it."""

from __future__ import annotations

import hashlib
import hmac
import os
import secrets
import stat
from pathlib import Path
from typing import Final

from mavlink_bridge.errors import KeyFileError

LENGTH: Final = 32
"""Length of a key in bytes."""
_MAX_FILE_BYTES: Final = 1024
_MIN_DIGITS: Final = 32
"""Hexadecimal digits from which on a line is a key, never a passphrase, so that a cut key is detected."""
_DIGITS: Final = frozenset("0123456789abcdefABCDEF")
# 32 characters of 5 random bits each, easy to type on a tablet: without digits that look like letters.
_LETTERS: Final = "abcdefghijklmnopqrstuvwxyz234567"
_GROUPS, _GROUP = 8, 4
_OTHERS: Final = stat.S_IRWXG | stat.S_IRWXO


class Key:
    """Secret of 32 bytes, printed only as its fingerprint.

    The fingerprint tells keys apart and reveals nothing else.
    """

    __slots__ = ("_secret",)

    def __init__(self, secret: bytes) -> None:
        """Raise ValueError unless ``secret`` has 32 bytes."""
        if len(secret) != LENGTH:
            raise ValueError(f"a key has {LENGTH} bytes, not {len(secret)}")
        self._secret = bytes(secret)

    @classmethod
    def of_passphrase(cls, text: str) -> Key:
        """Return the key of a passphrase as ground stations derive it: SHA-256 of the text in UTF-8."""
        return cls(hashlib.sha256(text.encode()).digest())

    def signature(self, data: bytes) -> bytes:
        """Return the six signature bytes that end a signed frame; ``data`` is everything before them."""
        return hashlib.sha256(self._secret + data).digest()[:6]

    @property
    def blank(self) -> bool:
        """Whether the key is all zeros, which means "no key" in SETUP_SIGNING."""
        return not any(self._secret)

    @property
    def fingerprint(self) -> str:
        """Eight hexadecimal digits that identify the key."""
        return hashlib.sha256(b"fingerprint" + self._secret).hexdigest()[:8]

    def __bytes__(self) -> bytes:
        return self._secret

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Key) and hmac.compare_digest(self._secret, other._secret)

    def __hash__(self) -> int:
        return hash(self._secret)

    def __repr__(self) -> str:
        return f"Key({self.fingerprint})"


def read_key(path: Path | str) -> Key:
    """Read the key from a file of one line: 64 hexadecimal digits, or a passphrase.

    Raises KeyFileError, with a message of one line, if the file is missing or unreadable, if it holds
    anything else, or (POSIX) if its mode gives any permission to users other than its owner.
    """
    text = _text(path)
    line = text.removesuffix("\n").removesuffix("\r")
    if not line or not line.isprintable():
        raise KeyFileError(
            f"{path}: holds no key; allowed is one line: {2 * LENGTH} hexadecimal digits, or a passphrase"
        )
    if len(line) >= _MIN_DIGITS and _DIGITS.issuperset(line):
        if len(line) != 2 * LENGTH:
            raise KeyFileError(
                f"{path}: has {len(line)} hexadecimal digits; a key has {2 * LENGTH} (a passphrase of this "
                f"length needs another character)"
            )
        key = Key(bytes.fromhex(line))
        if key.blank:
            raise KeyFileError(f"{path}: nothing but zeros is no key")
        return key
    return Key.of_passphrase(line)


def create_key(path: Path | str) -> Key:
    """Write a random passphrase to a new file that only its owner may read, and return its key.

    The file holds a passphrase and not digits, because ground stations accept nothing else. Raises
    KeyFileError, with a message of one line, if the file exists or cannot be created.
    """
    groups = ("".join(secrets.choice(_LETTERS) for _ in range(_GROUP)) for _ in range(_GROUPS))
    line = "-".join(groups)
    try:
        number = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except FileExistsError:
        raise KeyFileError(f"{path}: is there already; a key is not overwritten") from None
    except OSError as error:
        raise KeyFileError(f"{path}: cannot be written: {error.strerror}") from None
    try:
        with open(number, "w", encoding="ascii") as file:
            file.write(line + "\n")
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        # Nothing is left that looks like a key.
        Path(path).unlink(missing_ok=True)
        raise KeyFileError(f"{path}: cannot be written: {error.strerror}") from None
    return Key.of_passphrase(line)


def _text(path: Path | str) -> str:
    try:
        # Without O_NONBLOCK, opening a pipe would block.
        number = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
        with open(number, "rb") as file:
            found = os.fstat(number)
            if not stat.S_ISREG(found.st_mode):
                raise KeyFileError(f"{path}: is not a file")
            if os.name == "posix" and found.st_mode & _OTHERS:
                raise KeyFileError(
                    f"{path}: users other than its owner have permissions on it "
                    f"(mode {stat.S_IMODE(found.st_mode):03o}); chmod 600 {path}"
                )
            data = file.read(_MAX_FILE_BYTES + 1)
        if len(data) > _MAX_FILE_BYTES:
            raise KeyFileError(f"{path}: holds more than {_MAX_FILE_BYTES} bytes; a key is one line")
        return data.decode()
    except UnicodeDecodeError:
        raise KeyFileError(f"{path}: is not text; a key is one line of UTF-8") from None
    except OSError as error:
        raise KeyFileError(f"{path}: cannot be read: {error.strerror}") from None
