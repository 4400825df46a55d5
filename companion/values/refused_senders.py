"""Senders whose committed plans are refused."""

from __future__ import annotations

from typing import NamedTuple


class RefusedSenders(NamedTuple):
    """Senders whose plans are refused, by system id.

    ``doubled``: two vehicles send plans with the id. ``foreign``: plans are in another fleet frame.
    ``differing``: another of the settings that a fleet has in common differs, as with another fleet file.
    ``wrong_clock``: plans or statements are of a time that has not come yet, or the clock differs from the
    own one by more than two right clocks can.
    """

    doubled: tuple[int, ...] = ()
    foreign: tuple[int, ...] = ()
    differing: tuple[int, ...] = ()
    wrong_clock: tuple[int, ...] = ()
