"""MAVLink messages as JSON: one channel for each sender and message type, with a schema from the dialect."""

from __future__ import annotations

import json
import math
from base64 import b64encode
from collections.abc import Iterable, Iterator
from functools import cache, lru_cache
from typing import Final

from outrider.export import foxglove, foxglove_schemas, json_schema
from outrider.export.json_schema import Node, Schema
from outrider.export.mcap_file import Entry, entry
from outrider.logs.dialect import Field, Kind
from outrider.logs.message_stream import Log, LogMessage

POSITION, WORDS = "GLOBAL_POSITION_INT", "STATUSTEXT"
_AUTOPILOT_LINK = 0
_LEVELS: Final = (5, 5, 5, 4, 3, 2, 2, 1)
"""Foxglove's levels for MAV_SEVERITY 0…7: emergency, alert and critical all map to fatal."""


def entries(log: Log, messages: Iterable[LogMessage]) -> Iterator[Entry]:
    """Yield every message on ``/mavlink/SYSTEM/COMPONENT/NAME``, and positions and texts in Foxglove's types.

    In a run the topic is ``/mavlink/vehicle-OWNER/SYSTEM/COMPONENT/NAME``: the messages that the companion of
    that vehicle received and sent. Positions (GLOBAL_POSITION_INT) are repeated as LocationFix on
    ``/fix/SYSTEM``, and texts (STATUSTEXT) as Log on ``/log``; in a run only those of the owner's autopilot,
    so that each occurs once.
    """
    prefix = "/mavlink" if log.owner is None else f"/mavlink/vehicle-{log.owner}"
    for spoken in messages:
        kind = spoken.kind
        topic = f"{prefix}/{spoken.system}/{spoken.component}/{kind.name}"
        yield Entry(spoken.time, topic, schema_of(kind), encode(spoken))
        if kind.name in (POSITION, WORDS) and (
            log.owner is None or (spoken.link == _AUTOPILOT_LINK and spoken.system == log.owner)
        ):
            yield _fix(spoken) if kind.name == POSITION else _text(spoken)


@cache
def schema_of(kind: Kind) -> Schema:
    """Return the schema of a message type: MAVLink's field names and units, and ``_link``, the link (0…3)."""
    fields = {field.name: _node(field) for field in kind.fields}
    link = json_schema.integer("of the log: 0 autopilot, 1 swarm, 2 target, 3 ground in a run")
    return json_schema.schema(
        f"mavlink.{kind.name}", f"MAVLink {kind.name} ({kind.id})", _link=link, **fields
    )


def _node(field: Field) -> Node:
    what = ", ".join(part for part in (field.unit, field.enum) if part)
    if field.is_text:
        return json_schema.words(what)
    if field.is_bytes:
        return json_schema.base64(what)
    one = json_schema.number if field.is_float else json_schema.integer
    return json_schema.many(one(), what, field.length) if field.length else one(what)


class _Template:
    """Format string that encodes a message without text, bytes and arrays in one step.

    Nearly all messages are of this kind.
    """

    def __init__(self, kind: Kind) -> None:
        self.plain = not any(field.length or field.is_text for field in kind.fields)
        self.floats = tuple(field.name for field in kind.fields if field.is_float)
        parts = [f'"{field.name}":%({field.name}){_FORMATS.get(field.type, "d")}' for field in kind.fields]
        self.text = "{" + ",".join(['"_link":%(_link)d', *parts]) + "}"


_FORMATS: Final = {"float": ".9g", "double": ".17g"}
"""Number of digits from which the same number can be read back."""
_template = lru_cache(maxsize=None)(_Template)


def encode(spoken: LogMessage) -> bytes:
    """Return the fields of a message as JSON.

    JSON has neither NaN nor infinity: a field that is not finite, or an array that has such an item, is
    omitted.
    """
    values = {"_link": spoken.link, **spoken.kind.read(spoken.payload)}
    template = _template(spoken.kind)
    if template.plain and all(math.isfinite(values[name]) for name in template.floats):
        return (template.text % values).encode()
    for field in spoken.kind.fields:
        value = values[field.name]
        if field.is_bytes:
            values[field.name] = b64encode(value).decode()
        elif field.is_float and not all(map(math.isfinite, value if field.length else (value,))):
            del values[field.name]
    return json.dumps(values, separators=(",", ":"), allow_nan=False, ensure_ascii=False).encode()


def _fix(spoken: LogMessage) -> Entry:
    values = spoken.kind.read(spoken.payload)
    fix = {
        "timestamp": foxglove.stamp(spoken.time),
        "frame_id": f"vehicle-{spoken.system}",
        "latitude": values["lat"] / 1e7,
        "longitude": values["lon"] / 1e7,
        "altitude": values["alt"] / 1e3,
        "position_covariance": [0.0] * 9,
        "position_covariance_type": 0,
    }
    return entry(spoken.time, f"/fix/{spoken.system}", foxglove_schemas.LOCATION_FIX, fix)


def _text(spoken: LogMessage) -> Entry:
    values = spoken.kind.read(spoken.payload)
    severity = values["severity"]
    said = {
        "timestamp": foxglove.stamp(spoken.time),
        "level": _LEVELS[severity] if severity < len(_LEVELS) else 0,
        "message": values["text"],
        "name": f"{spoken.system}/{spoken.component}",
        "file": "",
        "line": 0,
    }
    return entry(spoken.time, "/log", foxglove_schemas.LOG, said)
