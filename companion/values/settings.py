"""The base of all settings."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Positive = Annotated[float, Field(gt=0.0, le=1e4)]
WireStep = Annotated[int, Field(gt=0, le=262_140, multiple_of=4)]
"""µs between the knots of a plan that fits the wire. A type of its own: a bound given again beside one that a
type has already is ignored."""


class Settings(BaseModel):
    """An unknown key is an error, and nothing changes after load."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
