"""Base of all settings."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Positive = Annotated[float, Field(gt=0.0, le=1e4)]
WireStep = Annotated[int, Field(gt=0, le=262_140, multiple_of=4)]
"""Time between the knots of a plan that fits the wire, µs.

It is not derived from another constrained type, because pydantic ignores a second bound of the same kind.
"""


class Settings(BaseModel):
    """Settings that refuse unknown keys and do not change after load.

    A model with renamed keys states ``renamed`` (former name: present name) in its JSON Schema, from which
    the loader of files takes it.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
