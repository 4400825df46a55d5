"""What the bridge raises. Bad bytes from outside never raise: they are counted and dropped."""

from __future__ import annotations


class BridgeError(Exception):
    """Base of every error of ``mavlink_bridge``."""


class EncodeError(BridgeError):
    """A value does not fit its MAVLink field: a programming error or a NaN that must not leave the
    process."""


class LogError(BridgeError):
    """A tlog cannot be opened or holds no MAVLink at all."""


class ScheduleError(BridgeError):
    """A period or phase that is not a whole number of base ticks."""


class PlanWireError(BridgeError):
    """A plan that does not fit into 128 bytes, or bytes that are not a plan."""


class EndpointError(BridgeError):
    """A text that names no endpoint: what is wrong with it, and what is allowed."""


class LinkError(BridgeError):
    """An endpoint cannot be opened: a host without address, a port in use, a device that is not there."""


class KeyFileError(BridgeError):
    """A key file that is not there, holds no key, or is open to others: what, where, and what is allowed."""
