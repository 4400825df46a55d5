"""Opens the endpoints of the vehicles, or names the port in use and the remedy."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack

from mavlink_bridge.clocks.clock import Clock
from mavlink_bridge.errors import LinkError
from mavlink_bridge.links.link import Link
from mavlink_bridge.links.opening import open_link
from outrider.errors import InputError
from outrider.sitl_server.addresses import Address


def wire(addresses: Sequence[Address], clock: Clock) -> list[list[Link]]:
    """Return the links of each vehicle. Raises InputError if one cannot be opened; then none stays open."""
    with ExitStack() as opened:
        every: list[list[Link]] = []
        for address in addresses:
            links = []
            for endpoint in address.endpoints:
                try:
                    link = open_link(endpoint, clock)
                except LinkError as error:
                    hint = "; is another SITL running? --port-base P puts all ports elsewhere"
                    raise InputError(f"{error}{hint if 'in use' in str(error) else ''}") from None
                opened.callback(link.close)
                links.append(link)
            every.append(links)
        opened.pop_all()
    return every
