"""Key files on the command line: what is wrong with one is bad input."""

from __future__ import annotations

from pathlib import Path

from mavlink_bridge.errors import KeyFileError
from mavlink_bridge.key import Key, create_key, read_key
from outrider.errors import InputError


def key_of(path: Path) -> Key:
    """The key in a file. InputError if there is none, or if others may read it."""
    try:
        return read_key(path)
    except KeyFileError as error:
        raise InputError(str(error)) from None


def new_key(path: Path) -> str:
    """A new key in a new file, and what there is to say of it. InputError if it cannot be made."""
    try:
        key = create_key(path)
    except KeyFileError as error:
        raise InputError(str(error)) from None
    return f"{path}: a passphrase of 160 random bits, for you alone; fingerprint of its key {key.fingerprint}"
