"""Warning of plans that are further apart than the flown ones."""

from __future__ import annotations

from typing import Final

from companion.config import CompanionConfig

LONGEST_US: Final = 50_000
"""Longest time (µs) between two plans of the field in shipped scenarios, sweeps and measured results."""


def doubts_of_plans(config: CompanionConfig) -> str:
    """Return a warning about the time between plans; empty if there is none.

    Committed plans are made once an epoch, whatever ``rates.replan_us`` is.
    """
    period = config.rates.replan_us
    if config.avoidance == "certified" or period <= LONGEST_US:
        return ""
    return (
        f"companion.rates.replan_us: {period} µs between plans is longer than {LONGEST_US}, with which "
        f"separation was measured: vehicles react later to each other; advised: at most {LONGEST_US}"
    )
