"""Limits of the own autopilot, determined before the go: request, read or time out, lower, report.

Each parameter that determines a limit is requested by its name until it is received (PARAM_REQUEST_READ,
PARAM_VALUE).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from types import MappingProxyType

from pymavlink.dialects.v20 import all as mavlink

from companion.config import CompanionConfig
from companion.flight.autopilots import Loop, Profile
from companion.flight.autopilots.limits import stock_parameters
from companion.flight.lowering import Lowered, lowered
from companion.flight.vehicle import Vehicle
from mavlink_bridge.messages import Message, ParamRequestRead, ParamValue, Source
from mavlink_bridge.wire.param_value import number_of

UNREAD = "the autopilot's parameters"
"""Value of ``waiting`` until all parameters have been received or ``PATIENCE`` is over."""
_MAX_REMARKS = 16
PATIENCE = 5_000_000
"""µs from the first request after which stock values are used for unanswered parameters."""
_RETRY_US = 500_000
"""µs between two requests for unanswered parameters."""
_REFRESH_US = 10_000_000
"""µs between two requests for all parameters once settled: they may be changed before the go."""


class Parameters:
    """Parameters of the autopilot of ``own``'s system; ``values``: the finite ones, by name."""

    def __init__(self, own: Source) -> None:
        self._own = own
        self._values: dict[str, float] = {}
        self.values: Mapping[str, float] = MappingProxyType(self._values)
        self._since: int | None = None
        self._asked = 0

    def forget(self) -> None:
        """Forget all requests and received parameters."""
        self._values.clear()
        self._since = None

    def receive(self, message: ParamValue, profile: Profile) -> None:
        """Receive a value, requested or not; ignore other parameters and values that are not finite."""
        if message.name in stock_parameters(profile.autopilot):
            value = number_of(message, bytewise=profile.bytewise)
            if value is not None:
                self._values[message.name] = value

    def unread(self, profile: Profile) -> tuple[str, ...]:
        """Return the names of the parameters that have not been received."""
        return tuple(name for name in stock_parameters(profile.autopilot) if name not in self._values)

    def settled(self, now: int, profile: Profile) -> bool:
        """Return whether all parameters are received at ``now`` (µs), or ``PATIENCE`` is over."""
        late = self._since is not None and now - self._since >= PATIENCE
        return late or not self.unread(profile)

    def requests(self, now: int, profile: Profile) -> list[Message]:
        """Return requests for missing parameters every 0.5 s; once settled, for all of them every 10 s."""
        settled = self.settled(now, profile)
        if self._since is None:
            self._since = now
        elif now - self._asked < (_REFRESH_US if settled else _RETRY_US):
            return []
        self._asked = now
        names = stock_parameters(profile.autopilot) if settled else self.unread(profile)
        target = self._own.system, mavlink.MAV_COMP_ID_AUTOPILOT1
        return [ParamRequestRead(self._own, -1, *target, name) for name in names]


class AutopilotLimits:
    """Limits of the autopilot of one ``vehicle``.

    Without ``limits_from_autopilot``, or with another avoidance than ``field``, nothing is requested and all
    limits are as configured. ``lowered`` changes only in ``step``, which is called only before the take-off
    or take-over. ``remarks``: the last texts to report; ``said``: number of texts so far. ``unread``: the
    parameters for which stock values are used.
    """

    def __init__(self, config: CompanionConfig, vehicle: Vehicle, own: Source) -> None:
        self._limits = config.limits
        self._on = config.limits_from_autopilot and config.avoidance == "field"
        self._vehicle = vehicle
        self._parameters = Parameters(own)
        self.lowered = Lowered(config.limits)
        self.remarks: deque[str] = deque(maxlen=_MAX_REMARKS)
        self.said = 0
        self.unread: tuple[str, ...] = ()
        self._found: dict[str, float] | None = None

    def receive(self, message: ParamValue) -> None:
        """Receive a parameter of the autopilot, whether the companion requested it or not."""
        profile = self._vehicle.profile
        if self._on and profile is not None:
            self._parameters.receive(message, profile)

    def forget(self) -> None:
        """Forget all requests and received parameters."""
        self._parameters.forget()
        self._found = None

    @property
    def waiting(self) -> str:
        """Reason why a start is not possible yet, or not at all; empty if there is none."""
        if not self._on:
            return ""
        return UNREAD if self._found is None else self.lowered.lacking

    @property
    def loop(self) -> Loop | None:
        """Loop gains of the autopilot, None for an unknown one."""
        profile = self._vehicle.profile
        return self.lowered.loop or (None if profile is None else profile.loop)

    @property
    def refuses(self) -> bool:
        """Whether the autopilot's limits are too low for an escort."""
        return self._on and self._found is not None and bool(self.lowered.lacking)

    def step(self, now: int) -> list[Message]:
        """Return the requests to send at ``now`` (µs).

        If the autopilot is silent all parameters are forgotten, because it may return with others.
        """
        profile = self._vehicle.profile
        if not self._on or profile is None:
            return []
        if not self._vehicle.alive:
            self.forget()
            return []
        requests = self._parameters.requests(now, profile)
        if self._parameters.settled(now, profile) and self._parameters.values != self._found:
            self._found = dict(self._parameters.values)
            before, self.lowered = self.lowered, lowered(self._limits, profile, self._found)
            self._remark(before, self._parameters.unread(profile))
        return requests

    def _remark(self, before: Lowered, unread: tuple[str, ...]) -> None:
        """Report the differences from ``before``, and the parameters that are newly ``unread``."""
        if unread and unread != self.unread:
            which = ", ".join(unread) if len(self._found or ()) else "any parameter"
            self._say(f"Autopilot does not tell {which}: stock values assumed")
        self.unread = unread
        if self.lowered.lacking and self.lowered.lacking != before.lacking:
            self._say(f"No go: an escort needs {self.lowered.lacking}")
        changes = self.lowered.changes
        if changes and changes != before.changes:
            self._say(f"Limits lowered to the autopilot's: {', '.join(changes)}")
        elif before.changes and not changes and not self.lowered.lacking:
            self._say("Limits are the file's again")

    def _say(self, text: str) -> None:
        self.remarks.append(text)
        self.said += 1
