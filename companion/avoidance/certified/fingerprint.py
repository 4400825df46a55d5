"""Fingerprint of the settings that two vehicles must have in common, for the separation of their plans.

Two vehicles compute the same planes, with the same distance between their plans, only if these settings are
equal: the fleet frame's origin, the knots and the epochs of plans, whether heights count, all parts of the
least distance between plans (``margins.between``) and its measure (``field.downwash``), the scale of fleet
time, and who takes part. Each statement of agreements carries the fingerprint.

Settings of one vehicle alone are not part of it: the limits of acceleration and the box of its plans, the
costs, the bounds of vehicles that share no plan (the vehicle itself keeps clear of those), and the times at
which it sends and waits.

The fingerprint is the CRC-32 of fixed-size integers, so that neither the order of the fleet's ids nor the
way in which a number is written changes it. A change of one setting by less than 2^32 of its units always
changes it; two other settings have the same fingerprint with a probability of 2^-32.
"""

from __future__ import annotations

from typing import NamedTuple
from zlib import crc32

from companion.config import CompanionConfig
from mavlink_bridge.frames import FleetFrame

_RULES = 3
"""Version of the rules of agreements and planes."""
_NANO, _MICRO = 1e9, 1e6
"""Units of angles (1e-9 °: 0.1 mm), and of lengths, speeds and k (1e-6 of the SI unit)."""
_UTC, _OWN = 0, -1
_RANGE = -3
"""Mark before the numbers of a limited range, which are left out without one (−2: of one in space)."""


class FleetIdentity(NamedTuple):
    """Identity of a fleet on the wire.

    ``fingerprint``: 32 bits of the common settings, in each statement. ``origin``: 8-bit fingerprint of the
    fleet frame, in each plan.
    """

    fingerprint: int
    origin: int


def identity(config: CompanionConfig, frame: FleetFrame) -> FleetIdentity:
    """Return the identity of the fleet of a vehicle with these settings, in this fleet frame."""
    return FleetIdentity(fingerprint(config, frame), frame.fingerprint)


def fingerprint(config: CompanionConfig, frame: FleetFrame) -> int:
    """Return the 32-bit fingerprint of the common settings."""
    certified, field, limits = config.certified, config.field, config.limits
    origin = frame.latitude * _NANO, frame.longitude * _NANO, frame.altitude * _MICRO
    estimate = certified.sigmas, field.position_sigma
    lengths = field.d_min, certified.tube, certified.drift, *estimate, *limits.fastest
    numbers = [
        _RULES,
        *(round(number) for number in origin),
        certified.dt_us,
        config.horizon.steps + 1,
        certified.epoch_us,
        config.planar,
        *(round(length * _MICRO) for length in lengths),
        certified.clock_us,
        round(config.plane_shift * _MICRO),
        _time_scale(config),
    ]
    if field.downwash != 1.0:
        # A ball is left out: its fingerprint is that of fleets from before this setting.
        numbers.append(round(field.downwash * _MICRO))
    if certified.range is not None:
        numbers += [_RANGE, round(certified.range * _MICRO), certified.contact_us]
    members = sum(1 << system for system in set(certified.fleet))
    data = b"".join(number.to_bytes(8, "little", signed=True) for number in numbers)
    return crc32(data + members.to_bytes(32, "little"))


def _time_scale(config: CompanionConfig) -> int:
    """Return what fleet time is: −1 the own clock, 0 UTC, else the id of the vehicle whose clock it is."""
    certified = config.certified
    return _OWN if certified.fleet_time == "own" else certified.time_sources.reference or _UTC
