"""Exceptions of the bridge.

Bad bytes from outside never raise: they are counted and dropped.
"""

from __future__ import annotations


class BridgeError(Exception):
    """Base class of every error of ``mavlink_bridge``."""


class EncodeError(BridgeError):
    """A value that does not fit its MAVLink field.

    The cause is a programming error, or a NaN that must not leave the process.
    """


class LogError(BridgeError):
    """A tlog that cannot be opened, or that holds no MAVLink."""


class ScheduleError(BridgeError):
    """A period or phase that is not a whole number of base ticks."""


class PlanWireError(BridgeError):
    """A plan that does not fit into 128 bytes, or bytes that are not a plan."""


class EndpointError(BridgeError):
    """A text that is not a valid endpoint; the message states the fault and the allowed forms."""


class LinkError(BridgeError):
    """An endpoint that cannot be opened: a host without address, a port in use, a missing device."""


class KeyFileError(BridgeError):
    """A key file that is missing, holds no key, or is accessible to others.

    The message states the fault, the file and what is allowed.
    """
