"""Examination on a live link, without I/O: bytes in, bytes out, and whether it is over."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.framing import Framer
from mavlink_bridge.wire.signing import Signing
from outrider.doctor.examination import Examination
from outrider.doctor.px4_events import genuine
from outrider.doctor.questions import Questions

_MIN_DURATION_US: Final = 5_000_000
"""Time of reception that suffices for rates and a clock (µs)."""


class Consultation:
    """Examination of the autopilot ``system`` (None: the lowest id), for ``limit`` µs at most.

    It lasts longer only to wait for the reasons of a failing pre-arm check. With
    ``signing`` it signs its requests and accepts signed frames only; the times must then be Unix time.
    """

    def __init__(self, limit: int, system: int | None = None, signing: Signing | None = None) -> None:
        self.examination = Examination(system)
        self._questions = Questions(self.examination)
        self._signing = signing or Signing()
        self._framer, self._codec = Framer(unknown=True), Codec(signing=self._signing)
        self._limit = limit
        self._start: int | None = None

    def step(self, now: int, arrived: Sequence[bytes]) -> list[bytes]:
        """Process what has ``arrived`` by ``now`` (µs); return what to send."""
        self._start = now if self._start is None else self._start
        hearing = self.examination.hearing
        hearing.wait(now)
        self._signing.present(now)
        for data in arrived:
            for frame in self._framer.feed(data):
                if not (frame.known or genuine(frame)):
                    continue
                refusal = self._signing.check(frame)
                if refusal is None:
                    hearing.receive(now, frame)
                else:
                    hearing.refused += 1
                    hearing.refusal = refusal.value
        hearing.bad, hearing.skipped_bytes = self._framer.bad, self._framer.skipped_bytes
        return [self._codec.encode(message) for message in self._questions.due(now)]

    def over(self, now: int) -> bool:
        """Return whether there is nothing more to wait for."""
        if self._start is None or self._questions.listening(now):
            return False
        passed = now - self._start
        return passed >= self._limit or (passed >= _MIN_DURATION_US and self._questions.done(now))

    def share(self, now: int) -> float:
        """Return the share (0…1) of the longest possible duration that has passed by ``now`` (µs)."""
        if self._start is None:
            return 0.0
        passed = now - self._start
        return passed / max(self._limit, passed + self._questions.listening(now), 1)

    def doing(self, now: int) -> str:
        """Return a short description of what it waits for."""
        if not self.examination.hearing.frames and not self.examination.hearing.refused:
            return "waiting for MAVLink"
        if self.examination.vehicle is None:
            return "waiting for an autopilot"
        if listening := self._questions.listening(now):
            return f"asking why the pre-arm check fails, {listening * 1e-6:.0f} s more at most"
        return "listening and asking"
