"""The own autopilot's parameters that say what it can follow, asked for one by one until each is heard
(PARAM_REQUEST_READ, PARAM_VALUE)."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from companion.flight.autopilots import Profile
from companion.flight.autopilots.limits import stock_parameters
from mavlink_bridge.messages import Message, ParamRequestRead, ParamValue, Source
from mavlink_bridge.wire.param_value import number_of

PATIENCE = 5_000_000
"""µs from the first request after which what is not answered counts as stock."""
_RETRY = 500_000
"""µs between two requests for what has not been answered."""
_AGAIN = 10_000_000
"""µs between two requests for all of it, once that is settled: somebody may change a parameter before the
go."""


class Parameters:
    """Of the autopilot of ``own``'s system. ``values``: finite ones, by name."""

    def __init__(self, own: Source) -> None:
        self._own = own
        self._values: dict[str, float] = {}
        self.values: Mapping[str, float] = MappingProxyType(self._values)
        self._since: int | None = None
        self._asked = 0

    def forget(self) -> None:
        """Nothing was asked or heard."""
        self._values.clear()
        self._since = None

    def receive(self, message: ParamValue, profile: Profile) -> None:
        """A value, whoever asked for it or set it."""
        if message.name in stock_parameters(profile.autopilot):
            value = number_of(message, bytewise=profile.bytewise)
            if value is not None:
                self._values[message.name] = value

    def unread(self, profile: Profile) -> tuple[str, ...]:
        """The names that are still to be heard."""
        return tuple(name for name in stock_parameters(profile.autopilot) if name not in self._values)

    def settled(self, now: int, profile: Profile) -> bool:
        """Whether all is heard at ``now`` (µs), or the time for it over."""
        late = self._since is not None and now - self._since >= PATIENCE
        return late or not self.unread(profile)

    def requests(self, now: int, profile: Profile) -> list[Message]:
        """For what is missing; once settled, now and then for all."""
        settled = self.settled(now, profile)
        if self._since is None:
            self._since = now
        elif now - self._asked < (_AGAIN if settled else _RETRY):
            return []
        self._asked = now
        names = stock_parameters(profile.autopilot) if settled else self.unread(profile)
        return [ParamRequestRead(self._own, -1, self._own.system, 1, name) for name in names]
