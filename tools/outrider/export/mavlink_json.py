"""MAVLink messages as JSON: a channel for each sender and type, with a schema out of the dialect."""

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
from outrider.logs.message_stream import Log, Spoken

POSITION, WORDS = "GLOBAL_POSITION_INT", "STATUSTEXT"
_AUTOPILOT_LINK = 0
_LEVELS: Final = (5, 5, 5, 4, 3, 2, 2, 1)
"""Foxglove's levels for MAV_SEVERITY: emergency, alert and critical are all fatal."""


def entries(log: Log, messages: Iterable[Spoken]) -> Iterator[Entry]:
    """Every message on ``/mavlink/SYSTEM/COMPONENT/NAME``, in a run ``/mavlink/vehicle-OWNER/…``: what the
    companion of that vehicle heard and said. Besides, positions as LocationFix on ``/fix/SYSTEM`` and texts
    on ``/log``: in a run those of the owner's autopilot, so that no message is there twice."""
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
    """A field is what MAVLink calls it, in MAVLink's units; with it the link (0…3) that it went over."""
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
    """How messages of a kind without text, bytes and arrays become JSON in one go: they are nearly all."""

    def __init__(self, kind: Kind) -> None:
        self.plain = not any(field.length or field.is_text for field in kind.fields)
        self.floats = tuple(field.name for field in kind.fields if field.is_float)
        parts = [f'"{field.name}":%({field.name}){_FORMATS.get(field.type, "d")}' for field in kind.fields]
        self.text = "{" + ",".join(['"_link":%(_link)d', *parts]) + "}"


_FORMATS: Final = {"float": ".9g", "double": ".17g"}
"""So many digits give the same number back."""
_template = lru_cache(maxsize=None)(_Template)


def encode(spoken: Spoken) -> bytes:
    """Its fields. JSON has no NaN and no infinity: a field that is one, and an array that holds one, is left
    out."""
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


def _fix(spoken: Spoken) -> Entry:
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


def _text(spoken: Spoken) -> Entry:
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
