"""State that an autopilot keeps over a restart; the node itself reads and writes no file."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from mavlink_bridge.wire.signing import LATEST
from sitl.autopilot.missions.items import Item


class Saved(BaseModel):
    """Persistent state of an autopilot.

    ``parameters``: values that differ from the initial ones, by name; ``plans``: mission, fence and rally
    points; ``signed_until``: the newest timestamp of a signed message (in 10 µs since the start of 2015). The
    JSON functions are ``model_dump_json`` and ``model_validate_json``, which refuses damaged data.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", ser_json_inf_nan="constants")

    parameters: dict[str, FiniteFloat] = {}
    plans: tuple[tuple[Item, ...], ...] = ()
    signed_until: int = Field(0, ge=0, le=LATEST)
