"""What an export has become."""

from __future__ import annotations

from typing import NamedTuple


class Written(NamedTuple):
    """How many channels, tables or subscriptions, how many messages or rows are in them, and how many had to
    be left out because a series may not go back in time."""

    topics: int
    messages: int
    out_of_order: int = 0
