"""What a vehicle knows of one that it may meet in a lane, itself among them."""

from __future__ import annotations

from typing import NamedTuple

from companion.values.horizon import Array


class Traveller(NamedTuple):
    """Vehicle whose newest plan ends at ``rest`` (3,), and that wants to go to ``goal`` (3,), m.

    A goal that is not known is where the plan ends. ``reached``: it has been at this goal, and only makes
    room for those that have not. If it had priority again beside its goal, it would push back the one that it
    has made room for.
    """

    rest: Array
    goal: Array
    reached: bool = False
