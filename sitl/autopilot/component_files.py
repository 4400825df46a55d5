"""Files that a vehicle serves by MAVLink FTP, beside its logs.

ArduPilot and PX4: ``@PARAM/param.pck``. PX4: the component metadata under ``etc/extras``, compressed with
xz: a general file that names the others, with their CRC-32.
"""

from __future__ import annotations

import json
import lzma
from collections.abc import Callable, Mapping
from typing import Final
from urllib.parse import parse_qs

from sitl.autopilot.parameters.packed import described, packed
from sitl.autopilot.parameters.values import Values
from sitl.values.checksum import crc32

GENERAL: Final = "etc/extras/component_general.json.xz"
_PARAMETERS: Final = "etc/extras/parameters.json.xz"
_PACKED: Final = "@PARAM/param.pck"
# COMP_METADATA_TYPE_PARAMETER
_TYPE_PARAMETER: Final = 1


class ComponentFiles:
    """Files by path; a path may carry a query (``?start=0&count=10&withdefaults=1``)."""

    def __init__(
        self, values: Values, *, metadata: bool, logs: Callable[[], Mapping[str, bytearray]]
    ) -> None:
        """``metadata``: whether there is component metadata. ``logs`` returns the logs by path."""
        self._values = values
        self._logs = logs
        self._metadata = _metadata(values) if metadata else {}

    @property
    def general_crc(self) -> int:
        """CRC-32 of the general metadata file."""
        return crc32(self._metadata[GENERAL])

    def read(self, path: str) -> bytes | None:
        """Return the contents of ``path``, or None if there is no such file."""
        name, _, query = path.partition("?")
        if name == _PACKED:
            return self._packed(query)
        if query:
            return None
        if name in self._metadata:
            return self._metadata[name]
        log = self._logs().get(name)
        return None if log is None else bytes(log)

    def directory(self, path: str) -> list[str] | None:
        """Return the entries of a directory as in MAVLink FTP (D name, F name TAB size), or None."""
        sizes = {name: len(data) for name, data in self._metadata.items()}
        sizes |= {name: len(log) for name, log in self._logs().items()}
        sizes[_PACKED] = len(self._packed(""))
        head = f"{path}/" if path else ""
        below = {name[len(head) :]: size for name, size in sizes.items() if name.startswith(head)}
        if not below and path:
            return None
        folders = sorted({name.partition("/")[0] for name in below if "/" in name})
        files = sorted(name for name in below if "/" not in name)
        return [f"D{name}" for name in folders] + [f"F{name}\t{below[name]}" for name in files]

    def _packed(self, query: str) -> bytes:
        said = parse_qs(query)
        numbers = {key: int(text) for key, (text, *_) in said.items() if text.isascii() and text.isdecimal()}
        defaults, start = numbers.get("withdefaults") == 1, numbers.get("start", 0)
        return packed(self._values, defaults=defaults, start=start, count=numbers.get("count") or None)


def _metadata(values: Values) -> dict[str, bytes]:
    parameters = _compressed(described(values))
    general = {
        "version": 1,
        "vendorName": "outrider",
        "modelName": "PX4 emulation",
        "metadataTypes": [
            {"type": _TYPE_PARAMETER, "uri": f"mftp://{_PARAMETERS}", "fileCrc": crc32(parameters)}
        ],
    }
    return {GENERAL: _compressed(general), _PARAMETERS: parameters}


def _compressed(said: dict[str, object]) -> bytes:
    # Ground stations decompress with a small library that knows no other check.
    return lzma.compress(json.dumps(said).encode(), check=lzma.CHECK_CRC32)
