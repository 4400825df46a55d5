"""A stranger on both links of companions in flight: replays, damaged traffic, frames of real logs, forged
neighbours and autopilots, signatures that are wrong.

Where the links are signed the flight is the one without a stranger, to the last bit. Where they are not, a
stranger with the name of the own autopilot *is* the own autopilot: what then holds is that nothing raises,
and that set-points stay finite and within the limits of speed and acceleration.
"""

from __future__ import annotations

import hashlib
import math
from collections import Counter, deque
from collections.abc import Callable, Sequence
from functools import cache
from random import Random

import numpy as np

from companion.flight.readiness import OPERATORS_GO
from companion.values.components import COMPONENT
from companion.values.phase import Phase
from mavlink_bridge.key import Key
from mavlink_bridge.messages import (
    BY_ID,
    CommandAck,
    ExtendedSysState,
    GlobalPosition,
    GpsGlobalOrigin,
    Heartbeat,
    LocalPosition,
    Message,
    SetpointLocal,
    Source,
    SysStatus,
)
from mavlink_bridge.node import Datagram
from mavlink_bridge.tlog.log import read_tlog
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.framing import leading_frames
from mavlink_bridge.wire.signing import Signing
from tests.mavlink_bridge.recorded_logs import PIECES, SHIPPED, WHOLE
from tests.soak.air_nodes import EPOCH, FIRST, FLEET, RADIUS, SECOND
from tests.soak.airfield import CONFIG, Airfield, Craft
from tests.soak.corpora import absurd_plan, frames, messages
from tests.soak.damage import WIRE_EDITS, absurd, damaged, framed

KEY, OTHER = Key.of_passphrase("correct horse"), Key.of_passphrase("battery staple")
BOUT, PEACE = 60.0, 40.0
"""s under siege, and s after it in which those who were misled have to be on their rings again."""
SINGLE = 1e-4
_REMEMBERED = 400
_OF_A_LOG = 1500
LOOK = 100_000


@cache
def recorded() -> tuple[bytes, ...]:
    """Frames of real flights: of the logs beside the checkout if they are there, of the pieces in any
    case."""
    found: list[bytes] = []
    for path in (SHIPPED, *PIECES, *WHOLE):
        for number, record in enumerate(read_tlog(path)):
            if number >= _OF_A_LOG:
                break
            found.append(record.frame)
    return tuple(found)


class Attacker:
    """A ``Node`` on the swarm link and on every autopilot's. It hears, remembers and says. ``quiet``: only
    hears."""

    name = "stranger"

    def __init__(self, seed: int, systems: Sequence[int]) -> None:
        self._random = Random(f"stranger {seed}")
        self._systems = systems
        self.places = {f"autopilot-{system}": f"autopilot-{system}" for system in systems} | {
            "swarm": "swarm"
        }
        self._received: deque[bytes] = deque(maxlen=_REMEMBERED)
        self._codec = Codec()
        self._forger = Signing(OTHER)
        self._signed = Codec(None, self._forger, 0)
        self._known = frames(messages())
        self.quiet = True
        self.said: Counter[str] = Counter()

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        for datagram in inbox:
            self._received.append(datagram.data)
        if self.quiet:
            return []
        self._forger.present(now)
        out: list[Datagram] = []
        for link in self.places.values():
            count = self._random.choice((0, 0, 1, 1, 2))
            out.extend(Datagram(link, self._data(now, link)) for _ in range(count))
        return out

    def _data(self, now: int, link: str) -> bytes:
        random = self._random
        kinds: dict[str, Callable[[], bytes]] = {
            "replayed": lambda: random.choice(self._received),
            "replayed, damaged": lambda: damaged(
                random, random.choice(self._received), self._known, WIRE_EDITS
            ),
            "recorded": lambda: random.choice(recorded()),
            "recorded, of others": lambda: self._renamed(link, random.choice(recorded())),
            "recorded, absurd": lambda: absurd(random, random.choice(recorded())),
            "recorded, damaged": lambda: damaged(random, random.choice(recorded()), self._known, WIRE_EDITS),
            "forged": lambda: self._codec.encode(self._forged(now, link)),
            "forged, signed with another key": lambda: self._signed.encode(self._forged(now, link)),
            "forged, signed with nothing": lambda: absurd(
                random, self._codec.encode(self._forged(now, link))
            ),
            "noise": lambda: random.randbytes(random.randrange(1, 600)),
        }
        name = random.choice(list(kinds))
        if not self._received and name.startswith("replayed"):
            name = "noise"
        self.said[name] += 1
        return kinds[name]() or b"\0"

    def _renamed(self, link: str, data: bytes) -> bytes:
        """As if the own autopilot had said it, or another companion."""
        found, _ = leading_frames(data)
        row = BY_ID.get(found[0].message_id) if found else None
        if row is None:
            return data
        system, component = self._speaker(link)
        return framed(self._random, row, found[0], (system, component), found[0].payload)

    def _speaker(self, link: str) -> Source:
        if link != "swarm":
            return Source(int(link.rpartition("-")[2]), 1)
        other = self._random.choice((*self._systems, 60, 61, self._random.randrange(1, 251)))
        return Source(other, self._random.choice((1, COMPONENT)))

    def _forged(self, now: int, link: str) -> Message:
        random, me = self._random, self._speaker(link)
        boot = random.choice((now - EPOCH, random.randrange(1 << 32) * 1000, 0))
        spot = np.array([random.gauss(0.0, 8.0), random.gauss(0.0, 8.0), random.gauss(5.0, 2.0)])
        speed = (random.gauss(0.0, 2.0), random.gauss(0.0, 2.0), random.gauss(0.0, 1.0))
        latitude, longitude, altitude = FLEET.to_geodetic(spot)
        if link == "swarm":
            if random.random() < 0.4:
                return absurd_plan(random, FLEET.fingerprint, now)._replace(source=me)
            return GlobalPosition(me, boot, latitude, longitude, altitude, 5.0, speed, None)
        north, east, down = spot[1], spot[0], -spot[2]
        return random.choice(
            (
                LocalPosition(me, boot, (north, east, down), speed),
                LocalPosition(me, boot, (north, east, down), speed),
                Heartbeat(me, 2, random.choice((3, 12)), 0x80, random.choice((4, 5, 9, 6 << 16)), 4),
                Heartbeat(me, 2, 3, 0, 0, random.choice((3, 5, 6, 8))),
                SysStatus(me, 0, 0, 0, 9.0, random.random()),
                GpsGlobalOrigin(me, latitude, longitude, altitude, 0),
                ExtendedSysState(me, 0, random.randrange(5)),
                CommandAck(me, random.choice((22, 176, 400, 511)), random.randrange(6), 0, 0, me.system, 195),
            )
        )


class Siege:
    """Flies ``seconds`` with ``count`` vehicles, signed or not, with a stranger or without. ``trails``: a
    digest of all that the companions have sent, every ten seconds."""

    def __init__(
        self,
        seed: int,
        seconds: float,
        *,
        signed: bool,
        besieged: bool,
        count: int = 3,
        progress: Callable[[float], None] = lambda _s: None,
    ) -> None:
        self.seconds, self._progress = seconds, progress
        self.signed, self._besieged = signed, besieged
        systems = range(FIRST, FIRST + count)
        self.stranger = Attacker(seed, systems)
        # An autopilot without a key obeys whoever speaks to it: that is not the companion's to prevent.
        self.field = Airfield(
            count,
            seed,
            self._take,
            KEY if signed else None,
            guests=[self.stranger],
            deaf=() if signed else tuple(f"sitl-{system}" for system in systems),
        )
        self._digest = hashlib.sha256()
        self.trails: list[str] = []
        self.setpoints = 0
        self.peaces = 0
        self.phases: Counter[str] = Counter()
        self._next_look = EPOCH
        self._next_trail = EPOCH + 10 * SECOND
        self._asked: dict[int, int] = {}
        self._at_peace = True

    def fly(self) -> None:
        """All of it."""
        self.field.loop.run(EPOCH + round(self.seconds * 1e6), self._tick)

    @property
    def refused(self) -> int:
        """Frames that did not count for their signatures."""
        return sum(
            counters.refused for craft in self.field.crafts for counters in craft.companion.counters.values()
        )

    def _take(self, system: int, now: int, message: SetpointLocal) -> None:
        self.setpoints += 1
        self._digest.update(repr((system, now, message)).encode())
        limits = CONFIG.limits
        numbers = (*message.position, *message.velocity, *message.acceleration, message.yaw, message.yaw_rate)
        assert all(map(math.isfinite, numbers)), message
        assert math.hypot(*message.acceleration) <= limits.a_total + SINGLE, message
        assert math.hypot(*message.velocity) <= math.hypot(*limits.v_max) + SINGLE, message

    def _tick(self, now: int) -> bool:
        if now < self._next_look:
            return False
        self._next_look = now + LOOK
        seconds = 1e-6 * (now - EPOCH)
        peace = seconds % (BOUT + PEACE) < PEACE
        if peace and not self._at_peace and not self.signed:
            self._start_anew()
        if not peace and self._at_peace:
            self._check_peace()
        self._at_peace = peace
        self.stranger.quiet = peace or not self._besieged
        for craft in self.field.crafts:
            self.phases[craft.companion.pilot.phase.value] += 1
            self._lead(craft, now)
        if now >= self._next_trail:
            self._next_trail = now + 10 * SECOND
            self.trails.append(self._digest.hexdigest()[:16])
            self._progress(seconds)
        return False

    def _start_anew(self) -> None:
        """Whoever was misled does not know it: its operator does."""
        for craft in self.field.crafts:
            craft.radio.boot()
            craft.slot.start()

    def _check_peace(self) -> None:
        """Up and around the target, whatever was before."""
        self.peaces += 1
        for craft in self.field.crafts:
            pilot = craft.companion.pilot
            assert pilot.phase is Phase.ESCORT, (craft.system, pilot.phase, pilot.waiting_for)
            off = craft.place - self.field.target.place
            far = math.hypot(math.hypot(off[0], off[1]) - RADIUS, off[2] - CONFIG.surface.height)
            assert far < 1.0, (craft.system, far)

    def _lead(self, craft: Craft, now: int) -> None:
        if not self.signed and craft.companion.pilot.phase is Phase.DONE:
            # It was told that it has landed, wherever it is: on with the next.
            craft.radio.boot()
            craft.slot.start()
        pilot = craft.companion.pilot
        waits = pilot.phase is Phase.CONNECT and pilot.waiting_for == OPERATORS_GO
        if (waits or pilot.phase is Phase.YIELDED) and now - self._asked.get(craft.system, 0) > 2 * SECOND:
            self._asked[craft.system] = now
            self.field.tower.go(craft.system)
