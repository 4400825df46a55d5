"""A swarm of points that are where their plans say, each with the certified mode of a companion, on a channel
that loses, delays, repeats and reorders."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from heapq import heappush
from itertools import count

import numpy as np

from companion.avoidance.certified.committed import horizon_of
from companion.config import CompanionConfig
from companion.config.certified import CertifiedConfig
from companion.config.planning import LimitsConfig
from companion.values.horizon import Array
from mavlink_bridge.messages import Tunnel
from mavlink_bridge.wire.agreements import PAYLOAD_TYPE as AGREEMENTS
from tests.companion.avoidance.certified.flown import Flown
from tests.companion.avoidance.certified.plans import DT, EPOCH
from tests.companion.avoidance.certified.rough import Habits, Rough, within
from tests.companion.avoidance.certified.vehicle import Vehicle

TICK = 20_000


class Swarm(Flown):
    """``starts`` (k, 3) m; systems are 1…k, and all expect each other unless ``strangers``."""

    def __init__(
        self,
        starts: Array,
        rough: Rough,
        habits: Sequence[Habits],
        seed: int,
        *,
        epoch: int = DT,
        strangers: bool = False,
        others: Mapping[int, Mapping[str, object]] | None = None,
        planar: bool = False,
        settings: Mapping[str, object] | None = None,
        v_max: tuple[float, float, float] | None = None,
        more: Mapping[str, object] | None = None,
    ) -> None:
        """``others``: other certified settings of some vehicles, by system id; ``settings``: of all.

        ``more``: other values of the companions' settings.
        """
        fleet = tuple(range(1, len(starts) + 1))
        expected: dict[str, object] = {
            "dt_us": DT,
            "epoch_us": epoch,
            # In space, too, where it is 0 by default: the laws are the same.
            "plane_shift": 0.75,
            "fleet": () if strangers else fleet,
        }
        certified = CertifiedConfig.model_validate({**expected, **(settings or {})})
        limits = LimitsConfig() if v_max is None else LimitsConfig(v_max=v_max)
        document: dict[str, object] = {"task": "goto", "avoidance": "certified", "turning_sense": "right"}
        document |= {"certified": certified, "planar": planar, "limits": limits, **(more or {})}
        config = CompanionConfig.model_validate(document)
        vehicles = [
            Vehicle(system, _config_of(config, others or {}, system), np.array(place), habit)
            for system, place, habit in zip(fleet, starts, habits, strict=True)
        ]
        self._rng, self._rough, self._serial = np.random.default_rng(seed), rough, count()
        self._phases = self._rng.integers(0, TICK, len(starts)).tolist()
        super().__init__(config, vehicles)

    def run(self, until: int, goals: Callable[[int, int], Array]) -> None:
        """From the beginning until ``until`` µs; ``goals`` by time and system."""
        order = sorted(zip(self._phases, self.vehicles, strict=True), key=lambda one: one[0])
        for tick in range(0, until, TICK):
            for phase, vehicle in order:
                since, habits = tick + phase, vehicle.habits
                if since < max(habits.on, vehicle.busy_until) or within(since, habits.frozen):
                    continue
                messages = vehicle.step(since, goals(since, vehicle.system))
                if vehicle.stall(since):
                    messages = []
                vehicle.note(messages)
                self.send(vehicle.busy_until, vehicle, messages)
                self.record(since, vehicle)

    def send(self, since: int, sender: Vehicle, messages: Sequence[Tunnel]) -> None:
        """Send ``messages``, which leave the vehicle at ``since`` (µs of the run)."""
        for message in messages:
            self.sent.append(message.payload)
            self._carry(since, sender, message)

    def _carry(self, since: int, sender: Vehicle, message: Tunnel) -> None:
        rough, rng = self._rough, self._rng
        unreceived = rough.mute + (rough.alone if message.payload_type == AGREEMENTS else ())
        mute = any(begin <= since < end and sender.system == whom for begin, end, whom in unreceived)
        for receiver in self.vehicles:
            if receiver is sender or receiver.system in rough.deaf:
                continue
            ends = {sender.system, receiver.system}
            cut = any(begin <= since < end and len(ends & whom) == 1 for begin, end, whom in rough.cuts)
            cut |= rough.reach < np.inf and not self._within(since, sender, receiver)
            for _ in range(1 + bool(rng.random() < rough.twice)):
                arrives = since + 1 + int(rng.random() * rough.delay)
                if rng.random() >= rough.loss and not (cut or mute):
                    heappush(receiver.inbox, (arrives, next(self._serial), message))
                    if rough.again:
                        heappush(receiver.inbox, (arrives + rough.again, next(self._serial), message))

    def _within(self, since: int, one: Vehicle, two: Vehicle) -> bool:
        """Whether two vehicles are within reach at ``since`` (µs of the run), where their plans are."""
        now, step = EPOCH + since, self.config.certified.epoch_us
        places = [horizon_of(v.plan(now - now % step)).at(now).position for v in (one, two)]
        return bool(np.linalg.norm(places[0] - places[1]) <= self._rough.reach)


def _config_of(
    config: CompanionConfig, others: Mapping[int, Mapping[str, object]], system: int
) -> CompanionConfig:
    certified = config.certified.model_copy(update=others.get(system, {}))
    return config.model_copy(update={"certified": certified})
