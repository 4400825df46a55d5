"""JSON Schemas of the configuration, for editors: ``python -m outrider.schemas config/schemas`` writes them.

A shipped file names its schema in its first line, which ``schema_line`` returns.
"""

from __future__ import annotations

import json
import sys
from os.path import relpath
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from outrider.compare.comparison import Comparison
from outrider.scenarios.cameras import CameraFile
from outrider.scenarios.fly_config import FlyConfig
from outrider.scenarios.scenario import Scenario
from outrider.sweep.grid import Sweep
from outrider.sweep.scenes import Scene
from sitl.vehicle.config import VehicleConfig

SCHEMAS: list[tuple[str, type[BaseModel]]] = [
    ("scenario", Scenario),
    ("companion", FlyConfig),
    ("vehicle", VehicleConfig),
    ("camera", CameraFile),
    ("sweep", Sweep),
    ("scene", Scene),
    ("comparison", Comparison),
]
"""The name of each schema file, and the model from which it is made."""


def schema(model: type[BaseModel]) -> dict[str, Any]:
    """Return the JSON Schema of the files of ``model``."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **model.model_json_schema()}


def text(model: type[BaseModel]) -> str:
    """Return the content of the schema file; the same model gives the same bytes."""
    return json.dumps(schema(model), indent=2, ensure_ascii=False) + "\n"


def schema_line(file: Path, schemas: Path, name: str) -> str:
    """Return the first line of ``file``, with the path from it to the schema ``name`` in ``schemas``."""
    target = relpath(schemas / f"{name}.json", file.parent).replace("\\", "/")
    return f"# yaml-language-server: $schema={target}"


def write(folder: Path) -> list[Path]:
    """Write every schema into ``folder`` and return the files."""
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for name, model in SCHEMAS:
        files.append(folder / f"{name}.json")
        files[-1].write_text(text(model), encoding="utf-8")
    return files


if __name__ == "__main__":
    if len(sys.argv) != 2 or sys.argv[1].startswith("-"):
        sys.exit("usage: python -m outrider.schemas FOLDER")
    write(Path(sys.argv[1]))
