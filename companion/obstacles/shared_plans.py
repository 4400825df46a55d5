"""Plans that neighbours share: decoded once in a process, dated by one clock for each sender."""

from __future__ import annotations

from functools import lru_cache

from companion.config import CompanionConfig
from companion.estimation.plan_clock import PlanClock
from companion.values.horizon import Horizon, HorizonTable, roll_out
from mavlink_bridge.errors import PlanWireError
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.wire.plan import unpack_motion


@lru_cache(maxsize=1024)
def read(payload: bytes) -> tuple[int, Horizon]:
    """Return fingerprint and horizon of a plan on the wire; raises PlanWireError.

    If many companions share a process, each plan is decoded once.
    """
    plan = unpack_motion(payload)
    horizon = roll_out(plan.epoch, plan.dt, plan.position, plan.velocity, plan.accelerations)
    horizon.knots.flags.writeable = False
    return plan.origin, horizon


class SharedPlans:
    """The latest plan of each sender, by system id, in ``table``."""

    def __init__(self, config: CompanionConfig, fleet: FleetFrame) -> None:
        self._delay, self._stale = config.neighbour.delay_us, config.guard.plan_stale_us
        self._fleet = fleet
        self._clocks: dict[int, PlanClock] = {}
        self._brief = False
        self.table = HorizonTable(config.horizon.steps + 1, config.horizon.dt_us)

    @property
    def brief(self) -> bool:
        """Whether the senders' clocks are a simulation's clock, see ``SenderClock``."""
        return self._brief

    @brief.setter
    def brief(self, value: bool) -> None:
        self._brief = value
        for clock in self._clocks.values():
            clock.brief = value

    def receive(self, now: int, system: int, payload: bytes) -> None:
        """Receive the plan in a TUNNEL payload of ``system`` at ``now`` (µs).

        Raises PlanWireError for a payload that is no plan, for a plan in another fleet frame, and for one
        from the future or from long ago, unless ``PlanClock`` attributes that to a wrong clock of the sender.
        """
        origin, horizon = read(payload)
        if origin != self._fleet.fingerprint or len(horizon.knots) < 2:
            raise PlanWireError("a plan in another fleet frame, or without knots")
        clock = self._clocks.get(system)
        if clock is None:
            clock = self._clocks[system] = PlanClock(self._delay, self._stale)
            clock.brief = self._brief
        begins = clock.begins(now, horizon.epoch, horizon.dt)
        if begins is None:
            raise PlanWireError("a plan that cannot be dated")
        if begins != horizon.epoch:
            horizon = Horizon(begins, horizon.dt, horizon.knots)
        self.table.put(system, horizon)
