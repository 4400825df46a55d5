"""Everyone on the link, as heard."""

from __future__ import annotations

from typing import Final

from mavlink_bridge.messages import Source
from mavlink_bridge.wire.converters import BY_ID
from mavlink_bridge.wire.framing import Frame
from outrider.doctor.speaker import Speaker

MOST: Final = 128
"""Speakers of whom note is taken: a flood of made-up ones must not fill the memory."""
SETPOINTS: Final = frozenset((82, 84, 86))
"""SET_ATTITUDE_TARGET, SET_POSITION_TARGET_LOCAL_NED, SET_POSITION_TARGET_GLOBAL_INT."""


class Hearing:
    """Fed with frames. ``begin``, ``end``: of all that was heard or waited for (µs); ``octets`` of frames;
    ``bad``, ``skipped_bytes``: frames whose checksum failed, and bytes that belong to no frame; ``unheard``:
    frames of those beyond the number of whom note is taken; ``refused``: frames that do not count for who has
    the key, and ``refusal`` why the last did not."""

    def __init__(self) -> None:
        self.speakers: dict[Source, Speaker] = {}
        self.begin: int | None = None
        self.end = 0
        self.frames = self.octets = self.bad = self.skipped_bytes = self.unheard = self.refused = 0
        self.refusal = ""

    def receive(self, now: int, frame: Frame) -> None:
        """``frame`` arrived at ``now`` (µs); a time that goes back counts as the one before."""
        now = self.wait(now)
        self.frames += 1
        self.octets += len(frame.data)
        source = Source(frame.system, frame.component)
        speaker = self.speakers.get(source)
        if speaker is None:
            if len(self.speakers) >= MOST:
                self.unheard += 1
                return
            speaker = self.speakers[source] = Speaker(source)
        row = BY_ID.get(frame.message_id)
        speaker.tell(now, frame, None if row is None else row.parse(source, frame.payload))

    def wait(self, now: int) -> int:
        """It is ``now`` (µs), whether or not somebody spoke; the time that counts."""
        self.begin = now if self.begin is None else self.begin
        self.end = max(self.end, now)
        return self.end

    @property
    def seconds(self) -> float:
        """How long, s."""
        return 0.0 if self.begin is None else (self.end - self.begin) * 1e-6

    @property
    def autopilots(self) -> list[Speaker]:
        """Those that fly something, by system id."""
        return [
            self.speakers[source] for source in sorted(self.speakers) if self.speakers[source].is_autopilot
        ]

    def vehicle(self, system: int | None = None, *, lowest: bool = False) -> Speaker | None:
        """The autopilot of ``system``, or the one that says most; ``lowest``: rather that with the lowest id,
        which does not change as they speak."""
        found = [one for one in self.autopilots if system is None or one.source.system == system]
        return max(
            found,
            key=lambda one: (
                one.source.system > 0,
                one.source.component == 1,
                -one.source.system if lowest else one.frames,
            ),
            default=None,
        )
