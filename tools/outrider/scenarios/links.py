"""Faults of a scenario's links: per kind of link, per direction, and partitions."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import product
from typing import Annotated, Self

from pydantic import Field, model_validator

from mavlink_bridge.network.simulated import Faults
from outrider.scenarios.part import Duration, Length, Milliseconds, Part, Seconds, Share, System

_WORDS = ("delay_ms", "jitter_ms", "loss", "duplication", "reordering", "burst")
Burst = Annotated[float, Field(ge=0.0, le=10_000.0)]
ROLES = ("companion", "autopilot", "target", "operator", "moving")
_WITH_ID = ("companion", "autopilot", "moving")


class Direction(Part):
    """Faults of one direction in place of the link's own; null keeps the link's value.

    ``sender`` and ``receiver`` are a role (companion, autopilot, target, operator, moving: an obstacle), the
    system id of a companion or a moving obstacle, or null for all.
    """

    sender: str | System | None = Field(None, description="role or system id of who sends; null: all")
    receiver: str | System | None = Field(None, description="role or system id of who receives; null: all")
    delay_ms: Milliseconds | None = Field(None, description="ms")
    jitter_ms: Milliseconds | None = Field(None, description="ms, largest additional delay")
    loss: Share | None = Field(None, description="share of the messages that are lost")
    duplication: Share | None = Field(None, description="share of the messages that arrive twice")
    reordering: Share | None = Field(None, description="share of the messages that later ones overtake")
    burst: Burst | None = Field(None, description="mean number of messages lost in a row; 0: each on its own")


def _faults(said: dict[str, float]) -> Faults:
    delay, jitter, loss, duplication, reordering, burst = (said[word] for word in _WORDS)
    return Faults(round(1000 * delay), round(1000 * jitter), loss, duplication, reordering, burst)


class Links(Part):
    """Faults of one kind of link."""

    delay_ms: Milliseconds = Field(20.0, description="ms")
    jitter_ms: Milliseconds = Field(0.0, description="ms, largest additional delay")
    loss: Share = Field(0.0, description="share of the messages that are lost")
    duplication: Share = Field(0.0, description="share of the messages that arrive twice")
    reordering: Share = Field(0.0, description="share of the messages that later ones overtake")
    burst: Burst = Field(0.0, description="mean number of messages lost in a row; 0: each on its own")
    directions: tuple[Direction, ...] = Field(
        (), max_length=64, description="exceptions by direction; for each value, the last match counts"
    )

    @model_validator(mode="after")
    def _bursts(self) -> Self:
        """Check for every sender and receiver that the burst is long enough for the loss."""
        said = {end for one in self.directions for end in (one.sender, one.receiver)}
        ends: list[set[str | int]] = [{role} for role in ROLES]
        ends += [{role, end} for role in _WITH_ID for end in said if isinstance(end, int)]
        for sender, receiver in product(ends if self.directions else ends[:1], repeat=2):
            faults = self.between(sender, receiver)
            if 0 < faults.burst < faults.least_burst:
                raise ValueError(
                    f"burst = {faults.burst:g} with loss = {faults.loss:g}; "
                    f"allowed: 0, or {faults.least_burst:.3g} and more"
                )
        return self

    @property
    def faults(self) -> Faults:
        """The link's own faults as values of the simulated network."""
        return _faults({word: getattr(self, word) for word in _WORDS})

    def between(self, sender: Iterable[str | int], receiver: Iterable[str | int]) -> Faults:
        """Return the faults from one node to another, each given by all its names."""
        result: dict[str, float] = {word: getattr(self, word) for word in _WORDS}
        senders, receivers = set(sender), set(receiver)
        for direction in self.directions:
            if direction.sender is not None and direction.sender not in senders:
                continue
            if direction.receiver is not None and direction.receiver not in receivers:
                continue
            for word in _WORDS:
                value = getattr(direction, word)
                if value is not None:
                    result[word] = value
        return _faults(result)


class SwarmLinks(Links):
    """Faults of the swarm link, and how far it reaches."""

    range: Length | None = Field(
        None,
        description="m, largest true distance of sender and receiver, when a message is sent, at which it"
        " arrives; null: any",
    )


class AllLinks(Part):
    """The four links of a companion."""

    autopilot: Links = Links(delay_ms=5.0)
    swarm: SwarmLinks = SwarmLinks()
    target: Links = Links()
    ground: Links = Links()


class PartitionPart(Part):
    """Partition of the swarm link: for a while nothing passes between ``members`` and all others."""

    at_s: Seconds = Field(description="after the goal event")
    for_s: Duration = Field(description="s that it lasts")
    members: tuple[System, ...] = Field(min_length=1, description="system ids")
