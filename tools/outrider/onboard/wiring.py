"""Open links of a companion; several of its links may share one physical link, which is opened once."""

from __future__ import annotations

from collections.abc import Collection
from contextlib import ExitStack
from typing import NamedTuple

from pymavlink.dialects.v20 import all as mavlink

from companion.config import CompanionConfig
from companion.telemetry.reception import accepts
from companion.values.components import COMPONENT
from mavlink_bridge.clocks.clock import Clock
from mavlink_bridge.errors import LinkError, LogError
from mavlink_bridge.key import Key
from mavlink_bridge.links.demultiplexer import DemultiplexedLink, Demultiplexer, Wants
from mavlink_bridge.links.endpoints import Endpoint
from mavlink_bridge.links.link import Link
from mavlink_bridge.links.opening import open_link
from mavlink_bridge.links.serial_port import SerialPort
from mavlink_bridge.links.streams import StreamLink
from mavlink_bridge.wire.header import Header
from outrider.errors import InputError
from outrider.supervision.duplicate_ids import DuplicateIds

LAST_VEHICLE = 250
"""Highest system id of a vehicle; higher ids belong to ground stations."""
_COMMANDS = (mavlink.MAVLINK_MSG_ID_COMMAND_INT, mavlink.MAVLINK_MSG_ID_COMMAND_LONG)
_SWARMS = frozenset(
    (
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        mavlink.MAVLINK_MSG_ID_TIMESYNC,
        mavlink.MAVLINK_MSG_ID_TUNNEL,
    )
)
"""Messages between companions.

The swarm link takes them only from vehicles other than the own one and the target, by system id.
"""


class Wiring(NamedTuple):
    """Open links of a companion.

    ``ends`` maps the companion's names of links to links. ``demultiplexers`` are the physical links;
    ``duplicates`` observes all of them.
    """

    ends: dict[str, DemultiplexedLink]
    demultiplexers: list[Demultiplexer]
    duplicates: DuplicateIds

    def physical(self, name: str) -> Link:
        """Return the physical link that carries the companion's link ``name``."""
        return next(demultiplexer.link for demultiplexer in self.demultiplexers if name in demultiplexer.ends)

    def drain(self) -> None:
        """Discard the messages received so far: they are older than the start."""
        for demultiplexer in self.demultiplexers:
            demultiplexer.forget()

    def lend(self, keep: Collection[str] = ()) -> None:
        """Release serial ports in this process, after a forked process has taken over the links.

        Those that carry one of the links ``keep`` stay open here.
        """
        for demultiplexer in self.demultiplexers:
            if isinstance(demultiplexer.link, SerialPort) and demultiplexer.ends.keys().isdisjoint(keep):
                demultiplexer.link.let_go()

    def release_unplugged(self) -> None:
        """Release unplugged serial ports, so that the process that reads them can open them again."""
        for demultiplexer in self.demultiplexers:
            if isinstance(demultiplexer.link, SerialPort):
                demultiplexer.link.release_broken()

    def take_over(self) -> None:
        """Use the links in a forked process, beside the one that it was forked from."""
        for demultiplexer in self.demultiplexers:
            if isinstance(demultiplexer.link, StreamLink):
                demultiplexer.link.take_over()

    def close(self) -> None:
        """Close all links."""
        for end in self.ends.values():
            end.close()


def wants(name: str, system: int, target: int, config: CompanionConfig) -> Wants:
    """Return a predicate for the frames of a physical link that belong to the companion's link ``name``.

    These are the frames that the companion processes there (``reception``), and others for its log. The
    companion's own frames, echoed by the link, belong to no link.
    """
    accepted = accepts(name, system, target, config)

    def autopilot(header: Header) -> bool:
        return header.system == system and header.component != COMPONENT

    def swarm(header: Header) -> bool:
        return header.system not in (system, target) and header.system <= LAST_VEHICLE

    def ground(header: Header) -> bool:
        if header.system != system:
            return True
        return header.message_id in _COMMANDS and header.component not in (
            mavlink.MAV_COMP_ID_AUTOPILOT1,
            COMPONENT,
        )

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
    endpoints: dict[str, Endpoint],
    system: int,
    target: int,
    config: CompanionConfig,
    clock: Clock,
    key: Key | None = None,
) -> Wiring:
    """Open the links; ``key``: that of their signatures.

    Raises InputError if a link cannot be opened, after closing the others.
    """
    with ExitStack() as opened:
        demultiplexers = []
        duplicates = DuplicateIds(system, clock, key)
        ends: dict[str, DemultiplexedLink] = {}
        for endpoint in dict.fromkeys(endpoints.values()):
            names = [name for name, other in endpoints.items() if other == endpoint]
            try:
                link = open_link(endpoint, clock)
            except (LinkError, LogError) as error:
                raise InputError(f"--{names[0]}: {error}") from None
            opened.callback(link.close)
            deal = {name: wants(name, system, target, config) for name in names}
            demultiplexers.append(Demultiplexer(link, deal, duplicates))
            ends |= demultiplexers[-1].ends
        opened.pop_all()
    return Wiring(ends, demultiplexers, duplicates)
