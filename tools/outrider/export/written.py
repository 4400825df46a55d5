"""Counts of what an export wrote."""

from __future__ import annotations

from typing import NamedTuple


class Written(NamedTuple):
    """Counts of an export.

    They are the number of channels, tables or subscriptions, the number of messages or rows in them, and the
    number of messages omitted because a series must not go back in time.
    """

    topics: int
    messages: int
    out_of_order: int = 0
