"""Links without a peer: why, in one line on standard error for each reason."""

from __future__ import annotations

from collections.abc import Sequence

from mavlink_bridge.links.endpoints import Endpoint
from mavlink_bridge.links.link import Link, failure_of
from outrider.terminal.lines import say


class MissingPeers:
    """Observer of ``links``, which are open at ``places``, one after the other."""

    def __init__(self, places: Sequence[Endpoint], links: Sequence[Link]) -> None:
        self._links = [(str(place), link) for place, link in zip(places, links, strict=True)]
        self._said = {place: "" for place, _ in self._links}

    def say(self) -> None:
        """Say why a link has no peer, if the reason is another than before."""
        for place, link in self._links:
            failure = failure_of(link)
            if failure and failure != self._said[place]:
                say(f"outrider view: {place}: no connection: {failure}; it is tried again every second")
            self._said[place] = failure
