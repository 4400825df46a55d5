"""Header filters of a companion's links, applied to each frame before anything is decoded."""

from __future__ import annotations

from collections.abc import Callable

from companion.config import CompanionConfig
from companion.config.target_source import CameraSource, message_of, speaker_of
from companion.values.components import AUTOPILOT

_DISTANCES, _TRAFFIC = 330, 246
"""Message ids of distance sensors and of traffic.

Sensors of the own system may send on both links; traffic may come from any sender on the swarm link.
"""
_PARAMETER = 22
_WHERE = {33, 385}
"""Messages with a neighbour's position and plan: not decoded while the relevance filter ignores it."""
_WANTED = {
    "autopilot": {0, 1, 24, 30, 32, 49, 77, 111, 193, 230, 245, 253},
    "swarm": {33, 111, 385},
    "ground": {75, 76},
}
LINKS = ("autopilot", "swarm", "target", "ground")
"""The links of a companion."""


def accepts(
    link: str,
    system: int,
    target: int,
    config: CompanionConfig,
    ignores: Callable[[int, int], bool] = lambda _sender, _component: False,
) -> Callable[[int, int, int], bool]:
    """Return the header filter of a link of the companion of ``system``.

    It takes message id, sender and component, and returns whether the message is wanted there and may come
    from that sender. ``target`` is the system id of the target. ``ignores`` takes sender and component on the
    swarm link and returns whether their positions and plans are to be ignored.
    """
    wanted = _WANTED.get(link, set())
    if link == "autopilot" and config.limits_from_autopilot:
        wanted = wanted | {_PARAMETER}
    source = config.target_source
    sensors = {_DISTANCES} if config.proximity is not None else set()
    sensors |= {_TRAFFIC} if config.traffic is not None else set()
    reported, speaker = message_of(source), speaker_of(source, system, target)
    if link == "autopilot":
        camera = reported if isinstance(source, CameraSource) else None
        return lambda identifier, sender, component: (
            (identifier in wanted and sender == system and component == AUTOPILOT)
            or (identifier in sensors and sender == system)
            or (identifier == camera and sender == speaker)
        )
    if link == "target":
        return lambda identifier, sender, _component: (
            identifier == reported and (speaker is None or sender == speaker)
        )
    if link == "swarm":
        wanted = wanted | (sensors & {_TRAFFIC})
        return lambda identifier, sender, component: (
            (
                identifier in wanted
                and sender != system
                and not (identifier in _WHERE and ignores(sender, component))
            )
            or (identifier in sensors and sender == system)
        )
    return lambda identifier, _sender, _component: identifier in wanted
