"""The schemas that editors read are those of the models, and every shipped file names its own."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from pydantic import BaseModel

from outrider.schemas import SCHEMAS, schema, schema_line, text, write

CONFIG = Path(__file__).parents[2] / "config"
FOLDER = CONFIG / "schemas"


def objects(node: Any) -> Iterator[dict[str, Any]]:
    """Every object with keys of its own within a schema."""
    if isinstance(node, dict):
        if "properties" in node:
            yield node
        node = list(node.values())
    if isinstance(node, list):
        for inner in node:
            yield from objects(inner)


@pytest.mark.parametrize(("name", "model"), SCHEMAS)
def test_the_file_is_the_model(name: str, model: type[BaseModel]) -> None:
    assert (FOLDER / f"{name}.json").read_text(encoding="utf-8") == text(model), "run `make schemas`"


@pytest.mark.parametrize(("name", "model"), SCHEMAS)
def test_an_unknown_key_is_an_error_everywhere(name: str, model: type[BaseModel]) -> None:
    for node in objects(schema(model)):
        assert node.get("additionalProperties") is False, node.get("title")


def explained(node: dict[str, Any], definitions: dict[str, Any]) -> bool:
    """Whether an editor shows what a key means: its description, that of its model, or its only value."""
    if "description" in node or "const" in node:
        return True
    inner = [node, *node.get("anyOf", []), node.get("items", {})]
    models = [str(one["$ref"]).rpartition("/")[2] for one in inner if "$ref" in one]
    return any("description" in definitions[name] for name in models)


@pytest.mark.parametrize(("name", "model"), SCHEMAS)
def test_every_key_is_explained(name: str, model: type[BaseModel]) -> None:
    whole = schema(model)
    unexplained = [
        f"{node.get('title')}.{key}"
        for node in objects(whole)
        for key, value in node["properties"].items()
        if not explained(value, whole.get("$defs", {}))
    ]
    assert unexplained == []


def test_there_is_no_schema_without_a_model() -> None:
    assert {path.stem for path in FOLDER.glob("*.json")} == {name for name, _ in SCHEMAS}


def test_every_shipped_file_names_its_schema() -> None:
    lines = {
        path: {schema_line(path, FOLDER, name) for name, _ in SCHEMAS} for path in CONFIG.glob("*/*.yaml")
    }
    for path, allowed in lines.items():
        if SCHEMAS:
            assert path.read_text(encoding="utf-8").split("\n", 1)[0] in allowed, path.relative_to(CONFIG)


def test_writing_makes_what_is_compared(tmp_path: Path) -> None:
    written = write(tmp_path / "schemas")
    assert [path.stem for path in written] == [name for name, _ in SCHEMAS]
    assert all(path.read_bytes() == (FOLDER / path.name).read_bytes() for path in written)
