"""Limits of the own autopilot, determined before the go: request, read or time out, lower, report."""

from __future__ import annotations

from collections import deque

from companion.config import CompanionConfig
from companion.flight.lowering import Lowered, lowered
from companion.flight.parameters import Parameters
from companion.flight.vehicle import Vehicle
from mavlink_bridge.messages import Message, ParamValue, Source

UNREAD = "the autopilot's parameters"
"""Value of ``waiting`` until the parameters have been received or the time for it is over."""
_REMARKS = 16


class AutopilotLimits:
    """Limits of the autopilot of one ``vehicle``.

    Without ``limits_from_autopilot`` nothing is requested and all limits are as configured. ``lowered``
    changes only in ``step``, which is not called in flight. ``remarks``: the last texts to report; ``said``:
    number of all of them. ``unread``: the parameters that were not answered in time.
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
        """Reason why a go is not accepted yet, or is impossible; empty if there is none."""
        if not self._on:
            return ""
        return UNREAD if self._found is None else self.lowered.lacking

    @property
    def refuses(self) -> bool:
        """Whether the autopilot's limits are too low for an escort."""
        return self._on and self._found is not None and bool(self.lowered.lacking)

    def step(self, now: int) -> list[Message]:
        """Return the requests to send at ``now`` (µs).

        If the autopilot is silent all is forgotten, because it may return with other parameters.
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
        """Report what has changed."""
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
