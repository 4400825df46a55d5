"""Damaged bytes through framer and codec: nothing raises, every byte is accounted for, what is handed out can
be said again, and good messages that follow are understood."""

from __future__ import annotations

from random import Random

from mavlink_bridge.messages import BY_TYPE, Heartbeat, Message, Source, StatusText
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.framing import LONGEST_FRAME, Frame, Framer
from tests.soak.campaigns import Mutants
from tests.soak.corpora import frames, logs, messages
from tests.soak.damage import WIRE_EDITS, absurd, damaged

FRAMES = frames(messages())
OTHERS = (*FRAMES, *logs())
SENDER = Source(77, 1)
# Without a start byte inside: or the end of damage might be taken to lie there, and a frame be cut.
GOOD = [
    (number, frame)
    for number in range(80)
    if not {0xFD, 0xFE} & set((frame := Codec().encode(Heartbeat(SENDER, 2, 3, 0, number, 4)))[1:])
][:60]
SHORTEST = 8


def stream(random: Random) -> bytes:
    """One to eight frames, of which some have absurd values under a good checksum and the rest is damaged."""
    chosen = [random.choice(FRAMES) for _ in range(random.randint(1, 8))]
    chosen = [absurd(random, frame) if random.random() < 0.5 else frame for frame in chosen]
    data = b"".join(chosen)
    return data if random.random() < 0.3 else damaged(random, data, OTHERS, WIRE_EDITS)


def pieces(random: Random, data: bytes) -> list[bytes]:
    """``data`` as a serial line hands it over."""
    cuts = sorted(random.randrange(len(data) + 1) for _ in range(random.randint(0, 12)))
    return [data[a:b] for a, b in zip([0, *cuts], [*cuts, len(data)], strict=True)]


def bits(message: Message) -> str:
    """A NaN is equal to itself."""
    return repr(message)


def test_any_stream_is_messages_and_counts(mutants: Mutants) -> None:
    for mutant in mutants:
        with mutant:
            data = stream(mutant.random)
            whole, cut = Codec(), Codec()
            found = whole.feed(data)
            apart = [message for piece in pieces(mutant.random, data) for message in cut.feed(piece)]
            assert [*map(bits, apart)] == [*map(bits, found)]
            assert cut.counters == whole.counters
            assert whole.counters.good == len(found)
            assert whole.pending_bytes <= LONGEST_FRAME
            for message in found:
                (again,) = Codec().feed(Codec().encode(message))
                # STATUSTEXT is said in ASCII alone.
                assert bits(again) == bits(message) or isinstance(message, StatusText)
            # Nothing that begins in the damage reaches further than the longest frame.
            after = [message for _, frame in GOOD for message in whole.feed(frame)]
            late = [number for number, _ in GOOD[LONGEST_FRAME // len(GOOD[0][1]) + 2 :]]
            received = [m.custom_mode for m in after if isinstance(m, Heartbeat) and m.source == SENDER]
            assert received[-len(late) :] == late
            assert whole.pending_bytes == 0


def test_every_byte_is_in_a_frame_or_counted(mutants: Mutants) -> None:
    for mutant in mutants:
        with mutant:
            data = stream(mutant.random)
            framer = Framer()
            found: list[Frame] = []
            for piece in pieces(mutant.random, data):
                found += framer.feed(piece)
                assert framer.pending_bytes <= LONGEST_FRAME
            assert framer.frames == len(found)
            assert all(frame.known and frame.data in data for frame in found)
            rest = len(data) - sum(len(frame.data) for frame in found)
            unknown = rest - framer.skipped_bytes - framer.pending_bytes
            assert framer.unknown * SHORTEST <= unknown <= framer.unknown * LONGEST_FRAME


def test_any_payload_is_a_message_or_bad(mutants: Mutants) -> None:
    """Every row of the table, every field at the ends of its range, every length."""
    for mutant in mutants:
        with mutant:
            codec = Codec()
            found = codec.feed(absurd(mutant.random, mutant.random.choice(FRAMES)))
            assert codec.counters == (len(found), 1 - len(found), 0, 0, 0, 0)
            for message in found:
                assert BY_TYPE[type(message)].pack(message)
