"""Links of a real-time run, all on this machine's loopback.

Autopilots, companions and operator use unicast UDP; the swarm, the target and the ground truth for cameras
each use a port of one multicast group of this run.
"""

from __future__ import annotations

import socket
from contextlib import ExitStack
from typing import NamedTuple

from mavlink_bridge.clocks.clock import Clock
from mavlink_bridge.links.link import Link
from mavlink_bridge.links.opening import open_link
from mavlink_bridge.links.udp import UdpListener
from sitl.camera.scene import LINK as SIGHT

_HOST = "127.0.0.1"


class Wiring(NamedTuple):
    """Open links of all nodes: for each node, its links by link name.

    ``autopilots`` and ``companions`` have one entry per vehicle, ``backup_nodes`` one per backup node.
    """

    autopilots: list[dict[str, list[Link]]]
    companions: list[dict[str, list[Link]]]
    backup_nodes: list[dict[str, list[Link]]]
    target: dict[str, list[Link]]
    moving: list[dict[str, list[Link]]]
    operator: dict[str, list[Link]]

    def close_others(self, own: dict[str, list[Link]]) -> None:
        """Close every link except ``own``: a process keeps only the links of its node."""
        nodes = (
            *self.autopilots,
            *self.companions,
            *self.backup_nodes,
            *self.moving,
            self.target,
            self.operator,
        )
        for node in nodes:
            if node is not own:
                for links in node.values():
                    for link in links:
                        link.close()


def wire(
    vehicles: int, clock: Clock, moving: int = 0, backup_nodes: int = 0, *, cameras: bool = False
) -> Wiring:
    """Open the links of ``vehicles``, ``moving`` obstacles and ``backup_nodes`` (numbers) on free ports.

    With ``cameras`` there is also the link of the ground truth that cameras see. Raises LinkError if a link
    cannot be opened, after closing the others.
    """
    with ExitStack() as opened:

        def opening(endpoint: str) -> Link:
            link = open_link(endpoint, clock)
            opened.callback(link.close)
            return link

        autopilots: list[dict[str, list[Link]]] = []
        companions: list[dict[str, list[Link]]] = []
        operator: list[Link] = []
        listening = [(opening(f"udpin:{_HOST}:0"), opening(f"udpin:{_HOST}:0")) for _ in range(vehicles)]
        group = _group(_port(listening[0][0]))
        swarm, target, sight = (f"mcast:{group}:{port},{_HOST}" for port in _free_ports(3))
        for vehicle, ground in listening:
            # As with real autopilots, the autopilot sends first.
            autopilots.append({"autopilot": [opening(f"udpout:{_HOST}:{_port(vehicle)}")]})
            companions.append(
                {
                    "autopilot": [vehicle],
                    "swarm": [opening(swarm)],
                    "target": [opening(target)],
                    "ground": [ground],
                }
            )
            operator.append(opening(f"udpout:{_HOST}:{_port(ground)}"))
        backups = []
        for autopilot, companion in list(zip(autopilots, companions, strict=True))[:backup_nodes]:
            # The backup node sends its set-points to the autopilot. It receives the data of the autopilot and
            # of the companion, and so detects whether the companion sends.
            ends = [opening(f"udpin:{_HOST}:0"), opening(f"udpin:{_HOST}:0")]
            for node, end in zip((autopilot, companion), ends, strict=True):
                node["autopilot"].append(opening(f"udpout:{_HOST}:{_port(end)}"))
            backups.append({"autopilot": ends, "swarm": [opening(swarm)]})
        obstacles = [{"swarm": [opening(swarm)]} for _ in range(moving)]
        played = {"target": [opening(target)]}
        if cameras:
            for node in (*autopilots, *obstacles, played):
                node[SIGHT] = [opening(sight)]
        wiring = Wiring(
            autopilots,
            companions,
            backups,
            played,
            obstacles,
            {"ground": operator},
        )
        opened.pop_all()
    return wiring


def _port(link: Link) -> int:
    if not isinstance(link, UdpListener):
        raise TypeError(f"{link!r} has no port of its own")
    return int(link.address[1])


def _group(port: int) -> str:
    """Return a multicast group of the local scope (RFC 2365) for this run only.

    It is unique on this machine, because no other run has the unicast ``port``.
    """
    return f"239.255.{port >> 8}.{port & 255}"


def _free_ports(count: int) -> list[int]:
    """Return ``count`` different free UDP ports; they are free when this function returns."""
    with ExitStack() as held:
        sockets = [held.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) for _ in range(count)]
        for one in sockets:
            one.bind((_HOST, 0))
        return [one.getsockname()[1] for one in sockets]
