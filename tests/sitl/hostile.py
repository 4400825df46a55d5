"""Clients that ask too much, send garbage, lie, or leave: 10 000 messages a second of it."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator, Sequence
from itertools import cycle
from random import Random
from typing import Any

from pymavlink.dialects.v20 import all as dialect

from mavlink_bridge import messages as m
from mavlink_bridge.key import Key
from mavlink_bridge.messages import BY_TYPE, CommandLong, Message, Source
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec
from tests.sitl.autopilot_rig import LINK, Rig

RATE = 10_000
"""Messages per second."""
STRANGER = Source(250, 190)
ZEROS = (0.0,) * 7
KEYS = Key(b"k" * 32), Key(bytes(32))


def command(number: int, *params: float, source: Source = STRANGER) -> CommandLong:
    values: Any = (*map(float, params), *ZEROS)[:7]
    return CommandLong(source, 11, 1, number, 0, values)


def sender(number: int) -> Source:
    """Somebody else each time, as far as there are ids."""
    return Source(1 + number % 255, number // 255 % 256)


ASKED: dict[str, Callable[[int], Message]] = {
    "heartbeats": lambda k: m.Heartbeat(sender(k), 6, 8, 0, k, 4),
    "positions": lambda k: m.GlobalPosition(sender(k), k, 47.0, 8.0, 500.0, 5.0, (1.0, 0.0, 0.0), None),
    "unknown commands": lambda k: command(31_000 + k % 10_000, source=sender(k)),
    "versions": lambda k: command(520),
    "messages": lambda k: command(512, (30, 32, 148, 242, 49, 9999)[k % 6]),
    "intervals": lambda k: command(510, k % 300),
    "rates": lambda k: command(511, 24, 1e5 + k % 2 * 1e5),
    "failures": lambda k: command(420, 4, 1),
    "lists of parameters": lambda k: m.ParamRequestList(sender(k), 11, 1),
    "parameters": lambda k: m.ParamRequestRead(STRANGER, k % 300, 11, 1, ""),
    "hashes": lambda k: m.ParamRequestRead(STRANGER, -1, 11, 1, "_HASH_CHECK"),
    "unknown parameters": lambda k: m.ParamRequestRead(STRANGER, -1, 11, 1, f"NO_{k}"),
    "settings of unknown parameters": lambda k: m.ParamSet(STRANGER, bytes(4), 11, 1, f"NO_{k}", 9),
    "settings out of range": lambda k: m.ParamSet(
        STRANGER, struct.pack("<f", -1e6 - k), 11, 1, ("GUID_TIMEOUT", "COM_OF_LOSS_T")[k % 2], 9
    ),
    "times": lambda k: m.Timesync(STRANGER, 0, k),
    "pings": lambda k: m.Ping(sender(k), k, k % 256, 0, 0),
    "files": lambda k: m.FileTransfer(STRANGER, 0, 11, 1, bytes((k % 256, 0, 0, 4)).ljust(251, b"\0")),
    "plans": lambda k: m.MissionRequestList(sender(k), 11, 1, k % 4),
    "items": lambda k: m.MissionRequest(sender(k), k % 9, 11, 1, k % 3),
    "items of no plan": lambda k: m.MissionItem(sender(k), (0.0,) * 4, 0, 0, 5.0, 0, 16, 11, 1, 6, 0, 1, 0),
    "plans that never come": lambda k: m.MissionCount(sender(k), 700, 11, 1, 1 + k % 2, 0),
    "ends of nothing": lambda k: m.MissionAck(sender(k), 11, 1, 0, 0, 0),
    "origins": lambda k: m.SetGpsGlobalOrigin(STRANGER, 47.0, 8.0, 100.0, 11, 0),
    "keys": lambda k: m.SetupSigning(STRANGER, k, 11, 1, KEYS[k % 2]),
}
"""Valid messages by what they are about; none changes how it flies."""


def crowd(count: int = 4_000, kinds: Sequence[str] = tuple(ASKED), codec: Codec | None = None) -> list[bytes]:
    """A message each, of all ``kinds`` in turn."""
    codec = codec or Codec()
    return [codec.encode(ASKED[kinds[k % len(kinds)]](k)) for k in range(count)]


def garbage(seed: int, count: int = 2_000) -> list[bytes]:
    """Pieces of anything: noise, starts of frames, frames that lack their end, frames with a bit turned."""
    random = Random(seed)
    good = crowd(count)

    def piece(frame: bytes) -> bytes:
        match random.randrange(5):
            case 0:
                return random.randbytes(random.randrange(1, 300))
            case 1:
                return random.choice((b"\xfd", b"\xfe", b"\xfd\xff\x00", b"\xfe\xfe\x00")) * random.randrange(
                    1, 60
                )
            case 2:
                return frame[: random.randrange(1, len(frame))]
            case 3:
                at = random.randrange(len(frame))
                return frame[:at] + bytes([frame[at] ^ 1 << random.randrange(8)]) + frame[at + 1 :]
            case _:
                return b"\xfd\xff\x00\x00" + random.randbytes(6)

    return [piece(frame) for frame in good]


def orders() -> list[Any]:
    """What would end a flight, in pymavlink's messages."""
    force = 21196.0
    long = dialect.MAVLink_command_long_message
    velocity = (0.0, 0.0, 5.0)
    return [
        long(11, 1, 400, 0, 0.0, force, 0, 0, 0, 0, 0),
        long(11, 1, 21, 0, *ZEROS),
        long(11, 1, 20, 0, *ZEROS),
        long(11, 1, 176, 0, 1.0, 5.0, 0, 0, 0, 0, 0),
        long(11, 1, 176, 0, 1.0, 4.0, 6.0, 0, 0, 0, 0),
        long(0, 0, 400, 0, 0.0, force, 0, 0, 0, 0, 0),
        dialect.MAVLink_set_mode_message(11, 1, 9),
        dialect.MAVLink_mission_clear_all_message(11, 1, 255),
        dialect.MAVLink_mission_set_current_message(11, 1, 0),
        dialect.MAVLink_set_position_target_local_ned_message(
            0, 11, 1, 1, 0x9C7, 0, 0, 0, *velocity, 0, 0, 0, 0, 0
        ),
        dialect.MAVLink_param_set_message(11, 1, b"WPNAV_SPEED", 20.0, 9),
        dialect.MAVLink_setup_signing_message(11, 1, [7] * 32, 1),
    ]


def flood(rig: Rig, data: Sequence[bytes], seconds: float, *mine: bytes) -> Iterator[list[bytes]]:
    """Let time pass under a flood, each message a datagram of its own and ``mine`` the last in every step;
    what is sent in each step."""
    pieces = cycle(data)
    for _ in range(round(seconds * 1e6 / rig.tick)):
        inbox = [Datagram(LINK, next(pieces)) for _ in range(RATE * rig.tick // 1_000_000)] if data else []
        inbox += [Datagram(LINK, one) for one in mine]
        sent = rig.autopilot.step(rig.now, inbox)
        rig.now += rig.tick
        yield [datagram.data for datagram in sent]


def received(sent: Sequence[bytes], kinds: type[Any] | tuple[type[Any], ...]) -> list[Any]:
    """The messages of some kinds; whatever was sent is sound."""
    codec = Codec(lambda message_id, _system, _component: message_id in wanted)
    wanted = {BY_TYPE[kind].id for kind in (kinds if isinstance(kinds, tuple) else (kinds,))}
    found = codec.feed(b"".join(sent))
    assert codec.counters.bad == codec.counters.skipped_bytes == 0
    return list(found)
