"""Warning of committed plans whose tube is nobody's measurement."""

from __future__ import annotations

from companion.config import CompanionConfig
from outrider.scenarios.fleet_file import stated_at


def doubts_of_tube(config: CompanionConfig) -> str:
    """Return a warning if neither file nor fleet file states ``certified.tube``; empty if one does."""
    if config.avoidance != "certified" or stated_at(config, ("certified", "tube")):
        return ""
    return (
        f"companion.certified.tube: not stated: {config.certified.tube:g} m, which is not measured, counts: "
        "the separation holds only if the autopilot keeps to it; advised: outrider preflight --fly"
    )
