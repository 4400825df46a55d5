"""What an autopilot keeps over a restart. The node reads and writes no file: it is given this, and gives
it."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from mavlink_bridge.wire.signing import LATEST
from sitl.autopilot.missions.items import Item


class Saved(BaseModel):
    """``parameters`` that are not as at first, by name; ``plans``: mission, fence and rally points;
    ``signed_until``: the newest stamp of a signed message (10 µs since 2015).

    As JSON: ``model_dump_json`` and ``model_validate_json``, which refuses what is damaged.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", ser_json_inf_nan="constants")

    parameters: dict[str, FiniteFloat] = {}
    plans: tuple[tuple[Item, ...], ...] = ()
    signed_until: int = Field(0, ge=0, le=LATEST)
