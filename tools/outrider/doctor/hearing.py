"""Everything received on a link, by sender."""

from __future__ import annotations

from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import BY_ID, Source
from mavlink_bridge.wire.framing import Frame
from outrider.doctor.sender_record import SenderRecord

MOST: Final = 128
"""Maximum number of senders that are recorded: a flood of invented ones must not fill the memory."""
SETPOINTS: Final = frozenset(
    (
        mavlink.MAVLINK_MSG_ID_SET_ATTITUDE_TARGET,
        mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED,
        mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_GLOBAL_INT,
    )
)


class Hearing:
    """Record of a link, fed with frames.

    ``begin`` and ``end`` span all that was received or waited for (µs). ``octets``: bytes of frames. ``bad``,
    ``skipped_bytes``: frames with a wrong checksum, and bytes that belong to no frame. ``unreceived``: frames
    of senders beyond the first ``MOST``. ``refused``: frames that failed the signature check; ``refusal``:
    why the last of these failed. ``failure``: why the link has no peer.
    """

    def __init__(self) -> None:
        self.senders: dict[Source, SenderRecord] = {}
        self.begin: int | None = None
        self.end = 0
        self.frames = self.octets = self.bad = self.skipped_bytes = self.unreceived = self.refused = 0
        self.refusal = self.failure = ""

    def receive(self, now: int, frame: Frame) -> None:
        """Add ``frame``, which arrived at ``now`` (µs); a time that goes back counts as the previous one."""
        now = self.wait(now)
        self.frames += 1
        self.octets += len(frame.data)
        source = Source(frame.system, frame.component)
        sender = self.senders.get(source)
        if sender is None:
            if len(self.senders) >= MOST:
                self.unreceived += 1
                return
            sender = self.senders[source] = SenderRecord(source)
        row = BY_ID.get(frame.message_id)
        sender.tell(now, frame, None if row is None else row.parse(source, frame.payload))

    def wait(self, now: int) -> int:
        """Advance the time to ``now`` (µs) without a frame; return the latest time so far (µs)."""
        self.begin = now if self.begin is None else self.begin
        self.end = max(self.end, now)
        return self.end

    @property
    def seconds(self) -> float:
        """Duration (s)."""
        return 0.0 if self.begin is None else (self.end - self.begin) * 1e-6

    @property
    def autopilots(self) -> list[SenderRecord]:
        """Senders that are autopilots, by system id."""
        return [self.senders[source] for source in sorted(self.senders) if self.senders[source].is_autopilot]

    def vehicle(self, system: int | None = None, *, lowest: bool = False) -> SenderRecord | None:
        """Return the autopilot of ``system`` (None: any), or None if there is none.

        Among several, system ids above 0 and component 1 have priority, then the most messages. ``lowest``
        selects the lowest id instead, which message counts do not affect.
        """
        found = [one for one in self.autopilots if system is None or one.source.system == system]
        return max(
            found,
            key=lambda one: (
                one.source.system > 0,
                one.source.component == mavlink.MAV_COMP_ID_AUTOPILOT1,
                -one.source.system if lowest else one.frames,
            ),
            default=None,
        )
