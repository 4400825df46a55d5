"""What a companion listens to, by link: asked of each frame's header before anything is decoded."""

from __future__ import annotations

from collections.abc import Callable

AUTOPILOT = 1
"""MAV_COMP_ID_AUTOPILOT1: other components of the vehicle have no say in where it is."""
_WANTED = {
    "autopilot": {0, 1, 30, 32, 49, 77, 245, 253},
    "swarm": {33, 111, 385},
    "target": {33},
    "ground": {75, 76},
}
LINKS = tuple(_WANTED)
"""The links of a companion."""


def accepts(link: str, system: int, target: int) -> Callable[[int, int, int], bool]:
    """Header filter of a link: the messages wanted there, from whom they may come."""
    wanted = _WANTED[link]
    if link == "autopilot":
        return lambda identifier, sender, component: (
            identifier in wanted and sender == system and component == AUTOPILOT
        )
    if link == "target":
        return lambda identifier, sender, _component: identifier in wanted and sender == target
    if link == "swarm":
        return lambda identifier, sender, _component: identifier in wanted and sender != system
    return lambda identifier, _sender, _component: identifier in wanted
