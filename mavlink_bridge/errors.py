"""Exceptions of the bridge.

The codec never raises for bad frames from outside: it counts and drops them.
"""

from __future__ import annotations


class BridgeError(Exception):
    """Base class of every error of ``mavlink_bridge``."""


class EncodeError(BridgeError):
    """A value that does not fit its MAVLink field.

    The cause is a programming error, or a NaN that must not leave the process.
    """


class LogError(BridgeError):
    """A tlog that cannot be created, opened or read, that holds no MAVLink, or a record out of its range."""


class ScheduleError(BridgeError):
    """An invalid period, phase, clock or node name of a loop."""


class PlanWireError(BridgeError):
    """A value that does not fit into its TUNNEL payload, or bytes that are no such payload.

    The payloads are plans, rosters, uncertainties and fleet times.
    """


class EndpointError(BridgeError):
    """A text that is not a valid endpoint; the message states the fault and the allowed forms."""


class LinkError(BridgeError):
    """An endpoint that cannot be opened: for example a port in use, or a missing device."""


class KeyFileError(BridgeError):
    """A key file that is missing, holds no key, or is accessible to others.

    The message states the fault, the file and what is allowed.
    """
