"""The links of a companion, opened: each physical link once, however many of the companion's lead over it."""

from __future__ import annotations

from contextlib import ExitStack
from typing import NamedTuple

from companion.config import CompanionConfig
from companion.telemetry.reception import accepts
from companion.values.components import AUTOPILOT, COMPONENT
from mavlink_bridge.clocks.clock import Clock
from mavlink_bridge.errors import LinkError, LogError
from mavlink_bridge.links.demultiplexer import Dealer, DealtLink, Wants
from mavlink_bridge.links.endpoints import Endpoint
from mavlink_bridge.links.link import Link
from mavlink_bridge.links.opening import open_link
from mavlink_bridge.links.serial_port import SerialPort
from mavlink_bridge.wire.header import Header
from outrider.errors import InputError
from outrider.supervision.duplicate_ids import Twin

LAST_VEHICLE = 250
"""System ids above are ground stations'."""
_COMMANDS = (75, 76)
_SWARMS = frozenset((33, 111, 385))
"""What companions tell each other: GLOBAL_POSITION_INT, TIMESYNC, TUNNEL. Other news may be anybody's."""


class Wiring(NamedTuple):
    """``ends`` by the companion's name for a link; ``dealers`` are the physical links, ``twin`` listens on
    all of them."""

    ends: dict[str, DealtLink]
    dealers: list[Dealer]
    twin: Twin

    def physical(self, name: str) -> Link:
        """The link below the end of that ``name``."""
        return next(dealer.link for dealer in self.dealers if name in dealer.ends)

    def drain(self) -> None:
        """Forget what has arrived: what was said before nobody listened counts no more."""
        for dealer in self.dealers:
            dealer.forget()

    def lend(self) -> None:
        """A process that was forked has them now."""
        for dealer in self.dealers:
            if isinstance(dealer.link, SerialPort):
                dealer.link.let_go()

    def close(self) -> None:
        """All of them."""
        for end in self.ends.values():
            end.close()


def wants(name: str, system: int, target: int, config: CompanionConfig) -> Wants:
    """Which frames of a physical link belong to the companion's link of that ``name``: all that it listens to
    there (``reception``), and what its log shall have. What it said itself, and comes back, belongs to
    none."""
    accepted = accepts(name, system, target, config)

    def autopilot(header: Header) -> bool:
        return header.system == system and header.component != COMPONENT

    def swarm(header: Header) -> bool:
        return header.system not in (system, target) and header.system <= LAST_VEHICLE

    def ground(header: Header) -> bool:
        if header.system != system:
            return True
        return header.message_id in _COMMANDS and header.component not in (AUTOPILOT, COMPONENT)

    rules: dict[str, Wants] = {
        "autopilot": autopilot,
        "swarm": swarm,
        "target": lambda header: header.system == target,
        "ground": ground,
    }
    rule = rules[name]

    def wanted(header: Header) -> bool:
        if header.system == system and header.component == COMPONENT:
            return False
        if rule(header):
            return True
        if name == "swarm" and header.message_id in _SWARMS:
            return False
        return name != "ground" and accepted(header.message_id, header.system, header.component)

    return wanted


def wire(
    endpoints: dict[str, Endpoint], system: int, target: int, config: CompanionConfig, clock: Clock
) -> Wiring:
    """Open them. InputError if one cannot be; then none stays open."""
    with ExitStack() as opened:
        dealers = []
        twin = Twin(system, clock)
        ends: dict[str, DealtLink] = {}
        for endpoint in dict.fromkeys(endpoints.values()):
            names = [name for name, other in endpoints.items() if other == endpoint]
            try:
                link = open_link(endpoint, clock)
            except (LinkError, LogError) as error:
                raise InputError(f"--{names[0]}: {error}") from None
            opened.callback(link.close)
            deal = {name: wants(name, system, target, config) for name in names}
            dealers.append(Dealer(link, deal, twin))
            ends |= dealers[-1].ends
        opened.pop_all()
    return Wiring(ends, dealers, twin)
