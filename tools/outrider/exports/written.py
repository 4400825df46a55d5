"""What an export has become."""

from __future__ import annotations

from typing import NamedTuple


class Written(NamedTuple):
    """How many channels, tables or subscriptions, and how many messages or rows are in them."""

    topics: int
    messages: int
