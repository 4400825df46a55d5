"""Identification of the vehicle on the autopilot's link: the own one, another one, or none yet."""

from __future__ import annotations

from pymavlink.dialects.v20 import all as mavlink

from companion.flight.autopilots import Profile
from companion.flight.autopilots.known import KNOWN, profile_of
from companion.telemetry.sharing import onboard_heartbeat
from mavlink_bridge.links.link import Link, failure_of
from mavlink_bridge.messages import Heartbeat, Source
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.signing import Signing
from outrider.errors import InputError

_HEARTBEAT_PERIOD_US = 1_000_000
_OTHERS_ONLY_TIMEOUT_US = 60_000_000
"""Time limit (µs) for the own vehicle's heartbeat after another's first: the own vehicle may boot last."""


class Identification:
    """Search for the own vehicle's heartbeat, polled until it succeeds.

    ``link``: the physical link, on which all vehicles are received. ``own``: sender of the heartbeats that
    this search sends; its system id is the own vehicle's.
    """

    def __init__(self, link: Link, endpoint: str, own: Source, signing: Signing | None) -> None:
        self._link, self._endpoint, self._own, self._system = link, endpoint, own, own.system
        self._signing = signing
        self._codec = Codec(
            lambda identifier, _system, component: (
                identifier == mavlink.MAVLINK_MSG_ID_HEARTBEAT and component == mavlink.MAV_COMP_ID_AUTOPILOT1
            ),
            signing,
        )
        self._others: dict[int, Heartbeat] = {}
        self._since: int | None = None
        self._next = 0

    def look(self, now: int) -> Heartbeat | None:
        """Return the own vehicle's heartbeat, None if none has arrived; ``now``: wall time (µs).

        Raises InputError if only other vehicles are received for 60 s, or if the own autopilot is not
        supported.
        """
        if self._signing is not None:
            self._signing.present(now)
        if now >= self._next:
            # Routers and autopilots that wait for a first message learn the return address from this
            # heartbeat.
            self._next = now + _HEARTBEAT_PERIOD_US
            self._link.send(self._codec.encode(onboard_heartbeat(self._own)))
        for data in self._link.receive():
            for message in self._codec.feed(data, whole=True):
                if isinstance(message, Heartbeat) and message.autopilot != mavlink.MAV_AUTOPILOT_INVALID:
                    if message.source.system == self._system:
                        return self._known(message)
                    self._others[message.source.system] = message
                    self._since = now if self._since is None else self._since
        if self._since is not None and now - self._since > _OTHERS_ONLY_TIMEOUT_US:
            raise InputError(self._mismatch())
        return None

    @property
    def waiting(self) -> str:
        """Description of the missing heartbeat.

        It has the systems received, the count of refused frames, and why there is no connection.
        """
        refused = self._codec.counters.refused
        unsigned = f"; {refused} heartbeats there are not signed with the key" if refused else ""
        others = f"; heard there: {', '.join(map(str, sorted(self._others)))}" if self._others else ""
        failure = failure_of(self._link)
        why = f"; no connection: {failure}" if failure else ""
        return f"a heartbeat of vehicle {self._system} on {self._endpoint}{others}{unsigned}{why}"

    def _known(self, beat: Heartbeat) -> Heartbeat:
        if profile_of(beat) is None:
            allowed = ", ".join(f"{profile.name} {number}" for number, profile in sorted(KNOWN.items()))
            raise InputError(
                f"--autopilot {self._endpoint}: vehicle {self._system} has an autopilot of kind "
                f"{beat.autopilot}; allowed: {allowed}"
            )
        return beat

    def _mismatch(self) -> str:
        received = ", ".join(
            f"{system} ({_name(profile_of(beat), beat)})" for system, beat in sorted(self._others.items())
        )
        return (
            f"system {self._system} is not on {self._endpoint}; heard there: {received}; allowed: one of "
            "these as system in the file, or with --system"
        )


def _name(profile: Profile | None, beat: Heartbeat) -> str:
    return f"autopilot {beat.autopilot}" if profile is None else profile.name
