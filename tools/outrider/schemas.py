"""JSON Schemas of the configuration, for editors: ``python -m outrider.schemas config/schemas`` writes them.

A shipped file names its schema in its first line; `schema_line` says how.
"""

from __future__ import annotations

import json
import sys
from os.path import relpath
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from outrider.scenarios.fly_config import FlyConfig
from outrider.scenarios.scenario import Scenario
from outrider.sweep.grid import Sweep
from outrider.sweep.scenes import Scene
from sitl.vehicle.config import VehicleConfig

SCHEMAS: list[tuple[str, type[BaseModel]]] = [
    ("scenario", Scenario),
    ("companion", FlyConfig),
    ("vehicle", VehicleConfig),
    ("sweep", Sweep),
    ("scene", Scene),
]
"""The name of each schema file, and the model that it is made from."""


def schema(model: type[BaseModel]) -> dict[str, Any]:
    """The JSON Schema of what may stand in a file of ``model``."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **model.model_json_schema()}


def text(model: type[BaseModel]) -> str:
    """The schema file's content: the same model gives the same bytes."""
    return json.dumps(schema(model), indent=2, ensure_ascii=False) + "\n"


def schema_line(file: Path, schemas: Path, name: str) -> str:
    """The first line of ``file``: where, seen from it, ``schemas`` holds the schema ``name``."""
    target = relpath(schemas / f"{name}.json", file.parent).replace("\\", "/")
    return f"# yaml-language-server: $schema={target}"


def write(folder: Path) -> list[Path]:
    """Write every schema into ``folder``; returns the files."""
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for name, model in SCHEMAS:
        files.append(folder / f"{name}.json")
        files[-1].write_text(text(model), encoding="utf-8")
    return files


if __name__ == "__main__":
    write(Path(sys.argv[1]))
