"""Key files given on the command line; a faulty file is bad input (InputError)."""

from __future__ import annotations

from pathlib import Path

from mavlink_bridge.errors import KeyFileError
from mavlink_bridge.key import Key, create_key, read_key
from outrider.errors import InputError


def key_of(path: Path) -> Key:
    """Return the key in a file; raise InputError if it cannot be read, or if other users may read it."""
    try:
        return read_key(path)
    except KeyFileError as error:
        raise InputError(str(error)) from None


def new_key(path: Path) -> str:
    """Create a key in a new file, and return the message for the user; raise InputError if that fails."""
    try:
        key = create_key(path)
    except KeyFileError as error:
        raise InputError(str(error)) from None
    return f"{path}: a passphrase of 160 random bits, for you alone; fingerprint of its key {key.fingerprint}"
