"""Ways over fixed obstacles: takes a place and a destination, gives the place to aim for on a free way."""

from __future__ import annotations

from typing import TYPE_CHECKING

from companion.config import CompanionConfig
from companion.config.obstacles import Obstacle, Post

if TYPE_CHECKING:
    from companion.ways.space_detour import SpaceDetour
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

    limits = config.limits.within(config.field.margin(1))
    parts = effort * config.way.parts
    return Way(config.way, _obstacles(config), limits, least, parts, planar=config.planar, spare=spare)


def space_detour_of(config: CompanionConfig, kept: float, between: float, spare: float) -> SpaceDetour:
    """Return the detours in space of a vehicle with ``config``.

    ``kept`` (m): what plans keep from fixed obstacles; ``between`` (m): from others. ``spare`` (m): wanted
    beyond these distances. The search is loaded only here.
    """
    from companion.ways.space_detour import SpaceDetour

    return SpaceDetour(_obstacles(config), config.limits.within(config.field.margin(1)), kept, between, spare)


def _obstacles(config: CompanionConfig) -> list[Obstacle]:
    """Return the fixed obstacles; plans with planes keep away from posts as if these had no top."""
    endless = config.avoidance == "certified"
    return [one.endless if endless and isinstance(one, Post) else one for one in config.obstacles]
