"""Channels of the simulated network, and their faults in each direction."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from mavlink_bridge.errors import BridgeError


class Faults(NamedTuple):
    """Faults that a channel applies to each datagram on its way to each receiver, independently.

    The delay is ``delay`` µs, plus up to ``jitter`` µs, uniform; ``loss``, ``duplication``, ``reordering``
    are probabilities in 0…1. A reordered datagram arrives one tick after the next datagram of its path
    that is not lost (never, if none follows). Jitter that exceeds the spacing of datagrams reorders them,
    too.

    ``burst``: with 0 the losses are independent of each other. Otherwise losses come in bursts of ``burst``
    datagrams on average, and ``loss`` remains the share of lost datagrams: the chain of Gilbert (1960) with
    two states, one that passes all and one that loses all. A burst below ``loss / (1 - loss)`` or 1 is
    impossible.
    """

    delay: int = 0
    jitter: int = 0
    loss: float = 0.0
    duplication: float = 0.0
    reordering: float = 0.0
    burst: float = 0.0

    @property
    def least_burst(self) -> float:
        """Shortest mean burst (datagrams) with which a share of ``loss`` is possible."""
        # Rounded, because 0.8 / (1 − 0.8) is a little more than 4.
        return max(1.0, round(self.loss / (1.0 - self.loss), 9)) if self.loss < 1 else 1.0

    @property
    def loss_after_loss(self) -> float:
        """Probability that a datagram is lost if the previous one on its path was lost."""
        return 1.0 - 1.0 / self.burst if self.burst and self.loss < 1 else self.loss

    @property
    def loss_after_passing(self) -> float:
        """Probability that a datagram is lost if the previous one on its path was not.

        With it, the share of losses is ``loss``.
        """
        return self.loss / (self.burst * (1.0 - self.loss)) if self.burst and self.loss < 1 else self.loss


Direction = tuple[str | None, str | None]
"""Node names of sender and receiver; None: any node."""


class Channel(NamedTuple):
    """Broadcast domain: a datagram that a member sends on its link reaches every other member on *its* link.

    ``members``: node name → that node's name for its link into this channel. ``overrides``: faults in place
    of ``faults`` for one direction. ``counted``: whether its datagrams count as traffic; if not, no other
    channel has its names of links.
    """

    name: str
    members: Mapping[str, str]
    faults: Faults = Faults()
    overrides: Mapping[Direction, Faults] = MappingProxyType({})
    counted: bool = True

    def between(self, sender: str, receiver: str) -> Faults:
        """Return the faults from ``sender`` to ``receiver``.

        The first that exists applies: the override for this pair, for this sender, for this receiver, for any
        pair, the channel's ``faults``.
        """
        for direction in ((sender, receiver), (sender, None), (None, receiver), (None, None)):
            if direction in self.overrides:
                return self.overrides[direction]
        return self.faults

    def check(self) -> None:
        """Raise BridgeError for invalid faults and for overrides of nodes that are not members."""
        _check(f"channel {self.name!r}", self.faults)
        for (sender, receiver), faults in self.overrides.items():
            where = f"channel {self.name!r}, from {sender or 'any'} to {receiver or 'any'}"
            for name in (sender, receiver):
                if name is not None and name not in self.members:
                    raise BridgeError(f"{where}: {name!r} is not a member; {', '.join(self.members)} are")
            _check(where, faults)


def _check(where: str, faults: Faults) -> None:
    for name in ("delay", "jitter"):
        if getattr(faults, name) < 0:
            raise BridgeError(f"{where}: {name} = {getattr(faults, name)} µs is negative")
    for name in ("loss", "duplication", "reordering"):
        if not 0 <= getattr(faults, name) <= 1:
            raise BridgeError(f"{where}: {name} = {getattr(faults, name)} is not in 0…1")
    if faults.burst != 0 and not faults.burst >= faults.least_burst:
        raise BridgeError(
            f"{where}: burst = {faults.burst} is neither 0 nor at least {faults.least_burst:.3g} datagrams"
        )
