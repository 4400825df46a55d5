"""Ways over fixed obstacles: takes a place and a destination, gives the place to aim for on a free way."""

from __future__ import annotations

from typing import TYPE_CHECKING

from companion.config import CompanionConfig
from companion.config.obstacles import Post

if TYPE_CHECKING:
    from companion.ways.way import Way


def way_of(config: CompanionConfig, least: float, effort: int = 1, spare: float = 0.0) -> Way | None:
    """Return the way of a vehicle with ``config``; None where ways are off or there is no fixed obstacle.

    ``least`` (m): clearance that a way must have, of which plans need not keep ``spare`` (m). A plan does
    ``effort`` times ``way.parts`` of a search. The search is loaded only here, because most companions need
    none.
    """
    if config.way is None or not config.obstacles:
        return None
    from companion.ways.way import Way

    # Plans with planes keep away from posts as if these had no top.
    endless = config.avoidance == "certified"
    obstacles = [one.endless if endless and isinstance(one, Post) else one for one in config.obstacles]
    limits = config.limits.within(config.field.margin(1))
    parts = effort * config.way.parts
    return Way(config.way, obstacles, limits, least, parts, planar=config.planar, spare=spare)
