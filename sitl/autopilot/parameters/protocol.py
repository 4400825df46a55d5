"""Parameter protocol: PARAM_REQUEST_LIST (21), PARAM_REQUEST_READ (20), PARAM_SET (23) → PARAM_VALUE (22)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import (
    Message,
    ParamRequestList,
    ParamRequestRead,
    ParamSet,
    ParamValue,
    Source,
)
from sitl.autopilot.parameters.parameter import decoded, encoded
from sitl.autopilot.parameters.values import Values
from sitl.telemetry.status_text import StatusReporter

HASH: Final = "_HASH_CHECK"
"""PX4's name for the hash of all names and values, which lets a client reuse a list that it has."""
_NO_NUMBER: Final = 0xFFFF
# A list is sent as ten messages (0.4 kB) every 10 ms: real links are slower, and no buffer overflows.
_BURST, _BURST_INTERVAL_US = 10, 10_000
_NEVER: Final = 1 << 62


class ParameterProtocol:
    """Server that sends and sets ``values``.

    ``next_due`` (µs): no ``work`` is due before it. A refused value is answered with the old value and with
    STATUSTEXT (253). ArduPilot omits the parameter's number in the answers to PARAM_SET and to a request by
    name; PX4 includes it, and also sends the hash.
    """

    def __init__(
        self,
        source: Source,
        values: Values,
        outbox: list[Message],
        status_text: StatusReporter,
        changed: Callable[[], None],
        *,
        bytewise: bool,
    ) -> None:
        """``changed`` is called after each new value. ``bytewise`` selects PX4's behaviour."""
        self._source = source
        self._values = values
        self._outbox = outbox
        self._status_text = status_text
        self._changed = changed
        self._bytewise = bytewise
        self._next = 0
        self._again = False
        self.next_due = _NEVER

    def handle(self, message: ParamRequestList | ParamRequestRead | ParamSet, now: int) -> None:
        """Handle a message for this vehicle that arrived at ``now`` (µs)."""
        match message:
            case ParamRequestList():
                # A request while a list is being sent gets the rest of it and then one more list. Real
                # firmwares restart at once, so that of two clients that keep asking neither receives the end.
                if self.next_due == _NEVER:
                    self._begin(now)
                else:
                    self._again = True
            case ParamRequestRead():
                self._read(message, now)
            case ParamSet():
                self._set(message, now)

    def work(self, now: int) -> None:
        """Send the next part of the list."""
        if self._next == len(self._values):
            self._begin(now)
        first, self._next = self._next, min(self._next + _BURST, len(self._values))
        goes_on = self._next < len(self._values) or self._again
        self.next_due = now + _BURST_INTERVAL_US if goes_on else _NEVER
        self._outbox += [self._value(number) for number in range(first, self._next)]

    def _begin(self, now: int) -> None:
        self._next, self._again, self.next_due = 0, False, now
        if self._bytewise:
            self._outbox.append(self._hash())

    def _read(self, message: ParamRequestRead, now: int) -> None:
        if message.number >= 0:
            if message.number < len(self._values):
                self._outbox.append(self._value(message.number))
            return
        if self._bytewise and message.name == HASH:
            self._outbox.append(self._hash())
            return
        number = self._values.number(message.name)
        if number is not None:
            self._outbox.append(self._named(number))
        elif self._bytewise:
            self._status_text.complain(f"unknown parameter {message.name}", now)

    def _set(self, message: ParamSet, now: int) -> None:
        values = self._values
        if self._bytewise and message.name == HASH:
            # This client has the list already; a client that has requested it since may not.
            if not self._again:
                self.next_due = _NEVER
            return
        number = values.number(message.name)
        if number is None:
            self._status_text.complain(f"unknown parameter {message.name}", now)
            return
        parameter = values.table[number]
        if self._bytewise and message.type != parameter.kind.value:
            refusal: str | None = f"{parameter.name}: wrong type"
        else:
            old = values.value(number)
            refusal = values.set(number, decoded(message.raw, parameter.kind, bytewise=self._bytewise))
            if refusal is None and values.value(number) != old:
                self._changed()
        if refusal:
            self._status_text.complain(refusal, now)
        self._outbox.append(self._named(number))

    def _named(self, number: int) -> ParamValue:
        value = self._value(number)
        return value if self._bytewise else value._replace(number=_NO_NUMBER)

    def _value(self, number: int) -> ParamValue:
        parameter = self._values.table[number]
        raw = encoded(self._values.value(number), parameter.kind, bytewise=self._bytewise)
        kind = parameter.kind.value
        return ParamValue(self._source, raw, len(self._values), number, parameter.name, kind)

    def _hash(self) -> ParamValue:
        raw = self._values.digest().to_bytes(4, "little")
        kind = mavlink.MAV_PARAM_TYPE_UINT32
        return ParamValue(self._source, raw, len(self._values), _NO_NUMBER, HASH, kind)
