"""The base of all settings."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class Settings(BaseModel):
    """An unknown key is an error, and nothing changes after load."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
