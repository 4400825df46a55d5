"""Group of vehicles as one node, so that one loop and one process run all of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Final

from mavlink_bridge.frames import ned_to_enu
from mavlink_bridge.node import Datagram, Node
from outrider.errors import OutriderError
from outrider.sitl_server.shared_page import SharedPage, VehicleSnapshot
from outrider.sitl_server.traffic import Traffic
from sitl.camera.scene import LINK as SIGHT
from sitl.node import LINK, Autopilot

SPREAD: Final = 240_000
"""Simulated time over which the vehicles of a group boot (µs), so that their telemetry is not due at once.

At speeds below 1 it is multiplied by the speed.
"""
SHOWN: Final = 0.2
"""Wall time between two snapshots of a vehicle (s)."""


class Slot:
    """One vehicle of a group.

    ``index`` is its number among all vehicles, ``node`` the autopilot, ``system`` the id that it was started
    with, ``link`` its link's name, ``boot`` the time at which it boots (µs).
    """

    def __init__(self, index: int, node: Autopilot, system: int, boot: int) -> None:
        self.index, self.node, self.system = index, node, system
        self.link = str(index)
        self.boot = boot
        self.shown = boot
        self.said = 0
        self.booted = False
        self.traffic = Traffic()


def boot_times(indices: Sequence[int], speed: float, period: int) -> dict[int, int]:
    """Return the boot time (µs) of each vehicle of one group, by index, at multiples of ``period`` (µs)."""
    spread = round(SPREAD * min(speed, 1.0))
    return {index: spread * number // len(indices) // period * period for number, index in enumerate(indices)}


class VehicleGroup:
    """Node whose links are those of its vehicles, named by their index."""

    name = "squad"

    def __init__(
        self,
        vehicles: Mapping[int, Autopilot],
        boots: Mapping[int, int],
        first_id: int,
        board: SharedPage,
        speed: float,
        target: Node | None = None,
    ) -> None:
        """Create a group.

        ``vehicles`` and ``boots`` (boot times, µs): by index among all vehicles, which is the row on the
        ``board``. ``first_id``: system id of index 0. ``speed``: simulated seconds per second. ``target``
        shows itself to the vehicles' cameras.
        """
        self._target = target
        self._light: list[Datagram] = []
        self.slots = [Slot(index, node, first_id + index, boots[index]) for index, node in vehicles.items()]
        self._board = board
        self._shown = round(SHOWN * 1e6 * speed)

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        """Step all vehicles that have booted, each with its own part of the ``inbox``."""
        mail: dict[str, list[Datagram]] = {}
        for link, data in inbox:
            mail.setdefault(link, []).append(Datagram(LINK, data))
        leaving = []
        # Cameras see where the target is now, and where this group's vehicles were after their last step.
        light, self._light = self._light, []
        if self._target is not None:
            light += [shown for shown in self._target.step(now, []) if shown.link == SIGHT]
        for slot in self.slots:
            if now < slot.boot:
                continue
            arrived = mail.get(slot.link, [])
            for datagram in arrived:
                slot.traffic.receive(datagram.data)
            try:
                # A vehicle's time begins with its first step: in a late process, too, this is the boot time.
                late = not slot.booted and now > slot.boot
                said = slot.node.step(slot.boot, []) if late else []
                slot.booted = True
                said += slot.node.step(now, [*arrived, *light])
            except Exception as error:
                raise OutriderError(f"vehicle {slot.system}: {type(error).__name__}: {error}") from error
            for datagram in said:
                if datagram.link == SIGHT:
                    self._light.append(datagram)
                    continue
                slot.traffic.send(datagram.data)
                leaving.append(Datagram(slot.link, datagram.data))
        return leaving

    def show(self, now: int, clients: Callable[[str], int]) -> None:
        """Write the snapshots that are due at ``now`` (µs); ``clients`` returns the clients on a link."""
        for slot in self.slots:
            if now < slot.shown:
                continue
            slot.shown = now + self._shown
            node, traffic, state = slot.node, slot.traffic, slot.node.state
            for text in traffic.sayings:
                self._board.say(slot.index, slot.said, text)
                slot.said += 1
            traffic.sayings.clear()
            east, north, up = ned_to_enu(state.position).tolist()
            u, v, w = ned_to_enu(state.velocity).tolist()
            self._board.show(
                slot.index,
                VehicleSnapshot(
                    True,
                    node.armed,
                    node.custom_mode,
                    (east, north, up),
                    (u, v, w),
                    node.charge,
                    traffic.received,
                    traffic.sent,
                    clients(slot.link),
                    slot.said,
                    (now - slot.boot) * 1e-6,
                ),
            )
