"""Parameters of the own autopilot that determine its limits (PARAM_REQUEST_READ, PARAM_VALUE).

Each is requested by its name until it is received.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from companion.flight.autopilots import Profile
from companion.flight.autopilots.limits import stock_parameters
from mavlink_bridge.messages import Message, ParamRequestRead, ParamValue, Source
from mavlink_bridge.wire.param_value import number_of

PATIENCE = 5_000_000
"""µs from the first request after which unanswered parameters count as stock."""
_RETRY = 500_000
"""µs between two requests for unanswered parameters."""
_AGAIN = 10_000_000
"""µs between two requests for all parameters once settled: a parameter may be changed before the go."""


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
        """Receive a value, whether the companion requested it or not."""
        if message.name in stock_parameters(profile.autopilot):
            value = number_of(message, bytewise=profile.bytewise)
            if value is not None:
                self._values[message.name] = value

    def unread(self, profile: Profile) -> tuple[str, ...]:
        """Return the names of the parameters that have not been received."""
        return tuple(name for name in stock_parameters(profile.autopilot) if name not in self._values)

    def settled(self, now: int, profile: Profile) -> bool:
        """Return whether all parameters are received at ``now`` (µs), or the time for it is over."""
        late = self._since is not None and now - self._since >= PATIENCE
        return late or not self.unread(profile)

    def requests(self, now: int, profile: Profile) -> list[Message]:
        """Return requests for missing parameters; once settled, for all of them from time to time."""
        settled = self.settled(now, profile)
        if self._since is None:
            self._since = now
        elif now - self._asked < (_AGAIN if settled else _RETRY):
            return []
        self._asked = now
        names = stock_parameters(profile.autopilot) if settled else self.unread(profile)
        return [ParamRequestRead(self._own, -1, self._own.system, 1, name) for name in names]
