"""Pages of settings, from the JSON Schemas of their models: keys with range, default and meaning."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

from pydantic import BaseModel

from companion.config import CompanionConfig
from outrider.scenarios.scenario import Scenario
from outrider.yaml_files.schema_nodes import Schema
from sitl.vehicle.config import VehicleConfig

_GENERATED = "This page is generated from the models by `make docs`; the JSON Schema for editors is"
_LONGEST = 60
"""Largest number of characters of a default that is shown."""
_COMPANION = "CompanionConfig"


def companion() -> str:
    """Return the page of the companions' settings."""
    head = f"""# Companion settings

{_GENERATED} [companion.json](../config/schemas/companion.json). These keys are in `companion:` of a
scenario and of a companion file of `outrider fly`, and are the arguments of `PlannerConfig` in Python.
Positions are east-north-up from the origin of the fleet, in metres; a key with another unit says so. """
    return head + _tables(CompanionConfig, "companion")


def scenario() -> str:
    """Return the page of scenario files."""
    head = f"""# Scenario files

{_GENERATED} [scenario.json](../config/schemas/scenario.json). A scenario is a YAML file; `outrider new
my.yaml --like escort` makes one. In Python the keys are arguments of `outrider.fly` and
`outrider.scenario`. Positions are east-north-up from the origin of the fleet, in metres; a key with another
unit says so. """
    return head + _tables(Scenario, "scenario", skip={_COMPANION: "companion.md"})


def vehicle() -> str:
    """Return the page of vehicle files."""
    head = f"""# Vehicle files

{_GENERATED} [vehicle.json](../config/schemas/vehicle.json). A vehicle is a YAML file; the shipped ones are
in `config/vehicles/`. In Python the keys are the arguments of `outrider.sim.VehicleConfig`. """
    return head + _tables(VehicleConfig, "vehicle")


def undescribed(model: type[BaseModel]) -> list[str]:
    """Return the keys, as ``Model.key``, that have no description of their own."""
    written = model.model_json_schema()
    return [
        f"{name}.{key}"
        for name, node in _models(written)
        for key, value in node.get("properties", {}).items()
        if not _meaning(written, value) and key != "kind"
    ]


def _models(written: Mapping[str, Any]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield name and schema of the model and of all that it contains."""
    yield str(written["title"]), written
    for name, node in written.get("$defs", {}).items():
        if "properties" in node:
            yield name, node


def _tables(model: type[BaseModel], title: str, skip: Mapping[str, str] | None = None) -> str:
    """Return the table of ``model`` and those of its parts; models in ``skip`` are on pages of their own."""
    written, skip = model.model_json_schema(), skip or {}
    reached = _reachable(written, skip)
    parts = []
    for name, node in _models(written):
        if name not in reached:
            continue
        heading = title if node is written else _heading(name)
        parts.append(f"\n## {heading}\n")
        said = node.get("description", "")
        if said:
            parts.append(f"\n{_cell(said.split(chr(10) * 2)[0])}\n")
        if not node.get("properties"):
            continue
        parts.append("\n| key | allowed | default | meaning |\n|---|---|---|---|\n")
        for key, value in node["properties"].items():
            needed = key in node.get("required", ())
            default = "required" if needed else _default(value)
            row = f"`{key}`", _allowed(written, value, skip), default, _cell(_meaning(written, value))
            parts.append(f"| {' | '.join(row)} |\n")
    return "".join(parts)


def _reachable(written: Mapping[str, Any], skip: Mapping[str, str]) -> set[str]:
    """Return the names of the models that are described on this page."""
    found, ahead = {str(written["title"])}, list(_references(written.get("properties", {})))
    while ahead:
        name = ahead.pop()
        if name not in found and name not in skip:
            found.add(name)
            ahead += _references(written["$defs"][name])
    return found


def _references(node: Any) -> Iterator[str]:
    """Yield the names of the models to which a schema refers."""
    if isinstance(node, Mapping):
        if "$ref" in node:
            yield str(node["$ref"]).rsplit("/", 1)[-1]
        for key, value in node.items():
            if key not in ("default", "discriminator"):
                yield from _references(value)
    elif isinstance(node, list):
        for value in node:
            yield from _references(value)


def _allowed(written: Mapping[str, Any], node: Mapping[str, Any], skip: Mapping[str, str]) -> str:
    """Return what a key may be: links to the tables of models, words for all else."""
    shape = {key: value for key, value in node.items() if key not in ("default", "description")}
    models = dict.fromkeys(_references(shape))
    linked = [_link(name, skip) for name in models if "properties" in written["$defs"][name]]
    null = " or null" if any(one.get("type") == "null" for one in node.get("anyOf", ())) else ""
    if linked:
        listed = "a list of " if node.get("type") == "array" else ""
        return listed + " or ".join(linked) + null
    return _cell(Schema(written, node).describe())


def _link(name: str, skip: Mapping[str, str]) -> str:
    shown = _heading(name)
    return f"[{shown}]({skip[name] if name in skip else '#' + shown.lower().replace(' ', '-')})"


def _heading(name: str) -> str:
    """Return the name of a model; one of two models of the same name says which."""
    *packages, last = name.split("__")
    return f"{last} as {'surface' if 'surfaces' in packages else 'obstacle'}" if packages else last


def _default(node: Mapping[str, Any]) -> str:
    """Return the default as YAML writes it; that of a part is in the part's own table."""
    if "default" not in node:
        return "empty"
    if isinstance(node["default"], Mapping):
        return "see there" if len(json.dumps(node["default"])) > _LONGEST else f"`{_yaml(node['default'])}`"
    return f"`{_yaml(node['default'])}`"


def _yaml(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {_yaml(one)}" for key, one in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_yaml, value)) + "]"
    return value if isinstance(value, str) else json.dumps(value)


def _meaning(written: Mapping[str, Any], node: Mapping[str, Any]) -> str:
    """Return the description of a key; without one, that of the one model that it holds."""
    if "description" in node:
        return str(node["description"])
    models = set(_references({key: value for key, value in node.items() if key != "default"}))
    said = written["$defs"][models.pop()].get("description", "") if len(models) == 1 else ""
    return str(said).split("\n\n")[0]


def _cell(text: str) -> str:
    """Return text for a cell of a table."""
    return " ".join(text.replace("``", "`").replace("|", "\\|").split())
