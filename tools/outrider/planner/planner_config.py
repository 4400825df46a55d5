"""Settings of a planner, made in Python."""

from __future__ import annotations

from typing import Any

from pydantic import ValidationError

from companion.config import CompanionConfig
from outrider.yaml_files.python_values import input_error


class PlannerConfig(CompanionConfig):
    """Settings of a planner: those of a companion (docs/companion.md), as keywords.

    Raises InputError, with a line for each wrong or unknown setting.
    """

    def __init__(self, **values: Any) -> None:
        try:
            super().__init__(**values)
        except ValidationError as error:
            raise input_error(error, CompanionConfig, values, "PlannerConfig") from None
