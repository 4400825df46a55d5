"""Page of the Python interface, from the signatures and docstrings of the public names."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from typing import Any

import outrider
from outrider import sim

_HEAD = """# Python interface

This page is generated from the docstrings by `make docs`. [python.md](python.md) is an introduction;
examples are in [examples/](../examples/README.md).

All public names are in `outrider` and in `outrider.sim`. They follow [semantic
versioning](https://semver.org/): while the version begins with 0, a new minor version may change them, and
[CHANGELOG.md](../CHANGELOG.md) says so; a new patch version does not. All other modules, and the packages
`companion`, `sitl` and `mavlink_bridge`, are internal and may change at any time.

Units are SI; positions are east-north-up (ENU), in metres; yaw is counter-clockwise from east, in radians.
"""
_SETTINGS = {
    "PlannerConfig": "companion.md",
    "Scenario": "scenario.md",
    "Post": "companion.md",
    "Box": "companion.md",
    "Wall": "companion.md",
    "Sphere": "companion.md",
    "VehicleConfig": "vehicle.md",
}
_PUBLIC = {"CompanionConfig": "PlannerConfig", "OwnSurface": "Surface", "FloatArray": "Array"}
"""Public names of classes that have another name inside."""
_INTERNAL = re.compile("|".join(_PUBLIC))
_DATA = {"Plan": ("horizon",)}
"""Attributes that are not part of the interface."""
_MADE_OTHERWISE = ("Plan", "Method", "Surface")
"""Classes that nobody makes by calling them: plans come from steps, and the others are protocols."""


def page() -> str:
    """Return the page."""
    parts = [_HEAD]
    for module, names in ((outrider, outrider.__all__), (sim, sim.__all__)):
        parts.append(f"\n## {module.__name__}\n")
        for name in names:
            if name in ("sim", "__version__"):
                continue
            parts.append(_described(name, getattr(module, name)))
    parts.append("\n`outrider.__version__` is the version, a text.\n")
    return "".join(parts)


def _described(name: str, value: Any) -> str:
    """Return the section of one name."""
    if name in _SETTINGS:
        text = (
            f"Settings, checked when they are made; see [{_SETTINGS[name]}]({_SETTINGS[name]}) for all keys."
        )
        return f"\n### {name}\n\n{text}\n"
    lines = [f"\n### {name}\n"]
    if not _is_plain_error(value) and name not in _MADE_OTHERWISE:
        lines.append(f"\n```python\n{name}{_signature(value)}\n```\n")
    lines.append(f"\n{_text(value)}\n")
    for member, thing in _members(name, value):
        if isinstance(thing, property) or not callable(getattr(thing, "__func__", thing)):
            lines.append(f"\n- `{member}`: {_text(thing, one_line=True)}")
        else:
            lines.append(f"\n- `{member}{_signature(thing, bound=True)}`: {_text(thing, one_line=True)}")
    return "".join(lines).rstrip() + "\n"


def _is_plain_error(value: Any) -> bool:
    return inspect.isclass(value) and issubclass(value, Exception)


def _members(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Yield the public methods and properties that a class itself defines and describes."""
    if not inspect.isclass(value) or _is_plain_error(value):
        return
    for member, thing in vars(value).items():
        if member.startswith("_") or member in _DATA.get(name, ()):
            continue
        raw = (
            getattr(thing, "func", None) or getattr(thing, "fget", None) or getattr(thing, "__func__", thing)
        )
        if callable(raw) and raw.__doc__:
            yield (
                member,
                thing
                if inspect.isfunction(thing)
                else (thing if isinstance(thing, classmethod) else property(raw)),
            )


def _signature(value: Any, *, bound: bool = False) -> str:
    """Return the signature as it is in the source; ``bound``: without the first parameter."""
    found = inspect.signature(getattr(value, "__func__", value))
    parts, starred = [], False
    for one in list(found.parameters.values())[bound:]:
        if one.kind is one.KEYWORD_ONLY and not starred:
            parts.append("*")
            starred = True
        mark = "*" * ((one.kind is one.VAR_POSITIONAL) + 2 * (one.kind is one.VAR_KEYWORD))
        default = "" if one.default is one.empty else f" = {one.default!r}"
        parts.append(f"{mark}{one.name}: {_annotation(one.annotation)}{default}")
    answer = "" if found.return_annotation in (found.empty, None, "None") else found.return_annotation
    return f"({', '.join(parts)})" + (f" -> {_annotation(answer)}" if answer else "")


def _annotation(value: Any) -> str:
    """Return an annotation as it is in the source, with the public names of classes."""
    text = value if isinstance(value, str) else getattr(value, "__forward_arg__", None) or str(value)
    return _INTERNAL.sub(lambda found: _PUBLIC[found[0]], text)


def _text(value: Any, *, one_line: bool = False) -> str:
    raw = getattr(value, "fget", None) or getattr(value, "__func__", value)
    text = inspect.getdoc(raw) or ""
    text = re.sub(r"``([^`]*)``", r"`\1`", text)
    return re.sub(r"\s*\n\s*", " ", text) if one_line else text
