"""What the own autopilot can follow, found out before the go: ask → read or time out → lower → say."""

from __future__ import annotations

from collections import deque

from companion.config import CompanionConfig
from companion.flight.lowering import Lowered, lowered
from companion.flight.parameters import Parameters
from companion.flight.vehicle import Vehicle
from mavlink_bridge.messages import Message, ParamValue, Source

UNREAD = "the autopilot's parameters"
"""What it waits for until they are heard or time is over."""
_REMARKS = 16


class AutopilotLimits:
    """Of one ``vehicle``. Without ``limits_from_autopilot`` it asks nothing and all is as configured.

    ``lowered`` changes in ``step`` alone, which is not called in flight. ``remarks``: the last of what there
    is to say; ``said`` counts all of them. ``unread``: the parameters that were not answered in time.
    """

    def __init__(self, config: CompanionConfig, vehicle: Vehicle, own: Source) -> None:
        self._limits = config.limits
        self._on = config.limits_from_autopilot and config.avoidance == "field"
        self._vehicle = vehicle
        self._parameters = Parameters(own)
        self.lowered = Lowered(config.limits)
        self.remarks: deque[str] = deque(maxlen=_REMARKS)
        self.said = 0
        self.unread: tuple[str, ...] = ()
        self._found: dict[str, float] | None = None

    def receive(self, message: ParamValue) -> None:
        """A parameter of the autopilot, whoever asked for it."""
        profile = self._vehicle.profile
        if self._on and profile is not None:
            self._parameters.receive(message, profile)

    def forget(self) -> None:
        """Nothing was asked or heard."""
        self._parameters.forget()
        self._found = None

    @property
    def waiting(self) -> str:
        """Why no go is taken yet, or what makes it impossible; empty if nothing does."""
        if not self._on:
            return ""
        return UNREAD if self._found is None else self.lowered.lacking

    @property
    def refuses(self) -> bool:
        """Whether the vehicle cannot fly an escort as it is set up."""
        return self._on and self._found is not None and bool(self.lowered.lacking)

    def step(self, now: int) -> list[Message]:
        """Requests to send at ``now`` (µs). An autopilot that is not heard may come back with others."""
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
        """Say what is new."""
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
