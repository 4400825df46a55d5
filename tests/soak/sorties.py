"""Sortie after sortie through a seeded plan of mishaps, and the laws that hold all the while.

Three kinds of laws. What is sent: finite, within limits, near the vehicle, only while the vehicle is ours.
What is said: a mishap is a concern in time, a concern a STATUSTEXT in time. What follows: each concern's
reaction, and after a rest everybody is up, around the target, and nothing is amiss.
"""

from __future__ import annotations

import gc
import math
import resource
from collections import Counter, deque
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import numpy as np

from companion.flight.guard import Holding
from companion.flight.readiness import OPERATORS_GO
from companion.values.phase import STEERED, Phase
from mavlink_bridge.messages import SetpointLocal
from tests.soak.air_nodes import EPOCH, RADIUS, SECOND
from tests.soak.airfield import CONFIG, Airfield, Craft
from tests.soak.mishaps import MISHAPS, NO_PLAN, OLD, UNHEARD, Mishap, Scene
from tests.soak.setpoint_laws import SetpointLaws

LOOK = 100_000
D_MIN = 0.5
LEG, REST = 200.0, 60.0
"""s: so long mishaps begin, and so long nothing happens; at the end of each rest all is well."""
EVERY = 5.0
"""s between two mishaps, on average."""
_DOWN = 90.0
_SPOKEN = 20.0
"""s in which what is a concern has been said, however much there is to say: one text a second."""


class Row(NamedTuple):
    """What is seen of a vehicle ten times a second."""

    now: int
    phase: Phase
    texts: frozenset[str]
    braking: bool
    place: np.ndarray


class Promise(NamedTuple):
    """``holds`` is asked at ``at``, unless vehicle or companion were started anew since then; None: it is not
    to be judged."""

    at: int
    craft: Craft
    age: tuple[int, int]
    what: str
    holds: Callable[[], bool | None]


class BrokenLawError(AssertionError):
    """One that was broken, and what came before."""


def planned(seed: int, first: float, seconds: float) -> list[tuple[float, Mishap, int, float]]:
    """When (from ``first`` on), what, to which vehicle (by a number), for how long (s)."""
    random = Random(f"mishaps {seed}")
    found, t = [], first
    while t < seconds:
        t += random.expovariate(1.0 / EVERY)
        what = random.choice(MISHAPS)
        lasts = random.uniform(*what.lasts)
        if t % (LEG + REST) < LEG:
            found.append((t, what, random.randrange(1 << 16), lasts))
    return found


def resident() -> int:
    """Bytes of this process in memory; its greatest so far where the system does not tell."""
    gc.collect()
    pages = Path("/proc/self/statm")
    if pages.exists():
        return int(pages.read_text().split()[1]) * resource.getpagesize()
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


class Sorties:
    """Flies ``seconds`` with ``count`` vehicles; ``progress`` hears the simulated seconds; ``first``: when
    (s) the first mishap may be."""

    def __init__(
        self,
        seed: int,
        seconds: float,
        count: int = 3,
        progress: Callable[[float], None] = lambda _s: None,
        first: float = 30.0,
    ) -> None:
        self.seed, self.seconds = seed, seconds
        self._progress = progress
        self._laws = SetpointLaws(self._must)
        self.field = Airfield(count, seed, self._take)
        self._by_system = {craft.system: craft for craft in self.field.crafts}
        self._plan = deque(planned(seed, first, seconds))
        self._running: list[tuple[float, Mishap, Scene]] = []
        self._promises: list[Promise] = []
        self._rows: dict[int, deque[Row]] = {craft.system: deque(maxlen=300) for craft in self.field.crafts}
        self._next_look = self._next_minute = EPOCH
        self._down_since: dict[int, int] = {}
        self._last_orders: dict[int, int] = {}
        self._rested = 0
        self._received: deque[tuple[int, int, str]] = deque(maxlen=2000)
        self.log: deque[str] = deque(maxlen=400)
        self.begun: Counter[str] = Counter()
        self.judged: Counter[str] = Counter()
        self.concerns: Counter[str] = Counter()
        self.landings: Counter[str] = Counter()
        self.sorties = self.texts = self.rests = 0
        self.least = math.inf
        self.memory: list[tuple[float, int]] = []

    def fly(self) -> None:
        """All of it. BrokenLawError for what is broken."""
        self.field.loop.run(EPOCH + round(self.seconds * 1e6), self._tick)

    def fingerprint(self) -> tuple[Any, ...]:
        """The same for the same seed."""
        places = tuple(tuple(craft.place.tolist()) for craft in self.field.crafts)
        return (
            places,
            tuple(sorted(self._laws.sent.items())),
            tuple(sorted(self.concerns.items())),
            self.texts,
        )

    @property
    def sent(self) -> Counter[int]:
        """Set-points of each."""
        return self._laws.sent

    def _take(self, system: int, now: int, message: SetpointLocal) -> None:
        self._laws.take(self._by_system[system], now, message)

    # What is seen

    def _tick(self, now: int) -> bool:
        self._separation()
        if now < self._next_look:
            return False
        self._next_look = now + LOOK
        seconds = 1e-6 * (now - EPOCH)
        self._listen()
        for craft in self.field.crafts:
            self._see(craft, now)
            self._lead(craft, now)
        self._strike(seconds)
        self._ask(now)
        if seconds % (LEG + REST) > LEG + REST - 0.15 and seconds - self._rested > 1.0:
            self._rested = seconds
            self._rest(now)
        if now >= self._next_minute:
            self._next_minute = now + 60 * SECOND
            for craft in self.field.crafts:
                craft.companion.shed()
            self.memory.append((seconds, resident()))
            self._progress(seconds)
        return False

    def _separation(self) -> None:
        flying = [craft for craft in self.field.crafts if craft.autopilot.armed and craft.autopilot.airborne]
        for k, one in enumerate(flying):
            for other in flying[:k]:
                apart = math.dist(one.autopilot.state.position, other.autopilot.state.position)
                self.least = min(self.least, apart)
                self._must(one, apart >= D_MIN, f"{apart:.2f} m from {other.system}")

    def _see(self, craft: Craft, now: int) -> None:
        companion = craft.companion
        texts = frozenset(concern.text for concern in companion.health.concerns.values())
        braking = companion.flown is None or companion.avoidance.state is Holding.BRAKING
        row = Row(now, companion.pilot.phase, texts, braking, craft.place)
        rows = self._rows[craft.system]
        before = rows[-1] if rows else row
        rows.append(row)
        if before.phase is not row.phase:
            self.note(craft, f"{before.phase.value} -> {row.phase.value}")
            self._explain(craft, before, row)
        for text in row.texts - before.texts:
            self.note(craft, f"begins: {text}")
            self._answer(craft, before, row, text)
        for text in before.texts - row.texts:
            self.note(craft, f"over: {text}")

    def note(self, craft: Craft | None, text: str) -> None:
        seconds = 1e-6 * (self.field.loop.now - EPOCH)
        self.log.append(f"{seconds:8.2f} {'' if craft is None else craft.system} {text}")

    def _must(self, craft: Craft, holds: bool, law: str) -> None:
        if not holds:
            self.note(craft, law)
            raise BrokenLawError(f"seed {self.seed}: {law}\n" + "\n".join(self.log))

    # What follows

    def _promise(self, craft: Craft, after: float, what: str, holds: Callable[[], bool | None]) -> None:
        age = craft.radio.boots, craft.slot.starts
        self._promises.append(Promise(self.field.loop.now + round(after * 1e6), craft, age, what, holds))

    def _ask(self, now: int) -> None:
        due = [promise for promise in self._promises if promise.at <= now]
        self._promises = [promise for promise in self._promises if promise.at > now]
        for _, craft, age, what, holds in due:
            if (craft.radio.boots, craft.slot.starts) != age:
                continue
            verdict = holds()
            if verdict is not None:
                self.judged[what] += 1
                self._must(craft, verdict, what)

    def _since(self, craft: Craft, seconds: float) -> list[Row]:
        now = self.field.loop.now
        return [row for row in self._rows[craft.system] if row.now >= now - seconds * 1e6 - 1]

    def _answer(self, craft: Craft, before: Row, row: Row, text: str) -> None:
        """A concern begins: what has to follow."""
        name = text.split(":")[0]
        name = "Battery" if name.startswith("Battery") else "Neighbour" if name.startswith("Neigh") else name
        self.concerns[name] += 1
        said = text if not text.startswith("Target lost") else "Target lost"
        # Of the target it tells on the ground already.
        begun = row.now - (20 * SECOND if said == "Target lost" else 0)
        self._promise(craft, _SPOKEN, "said: " + name, lambda: self._was_said(craft, said, begun))
        if text.endswith("landing") and before.phase in STEERED:
            gone = (Phase.ESCORT, Phase.HOLD, Phase.RETURN)
            self._promise(
                craft, 0.3, f"lands: {name}", lambda: self._rows[craft.system][-1].phase not in gone
            )
            self._promise(craft, _DOWN, f"is down: {name}", lambda: self._is_down(craft))
        if text.endswith("coming back") and before.phase in (Phase.ESCORT, Phase.HOLD):
            self._promise(craft, 0.3, f"returns: {name}", lambda: self._returns(craft))
        if text.startswith((OLD, NO_PLAN)):
            self._promise(craft, 0.8, f"brakes: {name}", lambda: self._brakes(craft, text, 0.8))
            self._promise(craft, 2.5, f"hovers: {name}", lambda: self._hovers(craft, text, 2.5))
        if text.startswith("Target lost"):
            self._promise(craft, 8.0, "holds: Target lost", lambda: self._stays(craft, text, 3.0))

    def _was_said(self, craft: Craft, text: str, since: int) -> bool:
        return any(
            received == text and system == craft.system and at >= since - 200_000
            for at, system, received in self._received
        )

    def _returns(self, craft: Craft) -> bool | None:
        """An operator may order otherwise."""
        if self.field.loop.now - self._last_orders.get(craft.system, 0) < 2 * SECOND:
            return None
        return self._rows[craft.system][-1].phase not in (Phase.ESCORT, Phase.HOLD)

    def _is_down(self, craft: Craft) -> bool | None:
        if any(row.phase is Phase.YIELDED for row in self._rows[craft.system]):
            return None
        return not craft.autopilot.armed

    def _steady(self, craft: Craft, text: str, seconds: float) -> bool:
        """Whether that was so all the while, and set-points steered it."""
        rows = self._since(craft, seconds)
        start = text.split(":")[0]
        return all(
            row.phase in STEERED
            and any(one.startswith(start) for one in row.texts)
            and UNHEARD not in " ".join(row.texts)
            for row in rows
        )

    def _brakes(self, craft: Craft, text: str, seconds: float) -> bool | None:
        if not self._steady(craft, text, seconds - 0.1):
            return None
        # In the last of them a plan may have come already that nobody has looked at yet.
        return any(row.braking for row in self._since(craft, 0.3))

    def _hovers(self, craft: Craft, text: str, seconds: float) -> bool | None:
        """The set-points are at rest, or there are none."""
        if not self._steady(craft, text, seconds - 0.1) or not craft.companion.pilot.guided:
            return None
        last = self._laws.last.get(craft.system)
        if last is None or self.field.loop.now - last.now > 200_000:
            return True
        return math.hypot(*last.message.velocity) < 0.1

    def _stays(self, craft: Craft, text: str, seconds: float) -> bool | None:
        rows = self._since(craft, seconds)
        calm = all(row.phase is Phase.ESCORT and row.texts == {text} for row in self._since(craft, 7.9))
        if not calm or any(scene.craft is craft and not m.whole for _, m, scene in self._running):
            return None
        return float(np.linalg.norm(rows[-1].place - rows[0].place)) < 1.0

    def _explain(self, craft: Craft, before: Row, row: Row) -> None:
        """Nobody turns back or lands for no reason."""
        now, after = row.now, row.phase
        if before.phase not in (Phase.ESCORT, Phase.HOLD) or after not in (Phase.RETURN, Phase.SETTLE):
            return
        words = "coming back" if after is Phase.RETURN else "landing"
        told = now - self._last_orders.get(craft.system, 0) < 2 * SECOND
        reason = told or any(text.endswith(words) for one in self._since(craft, 1.0) for text in one.texts)
        self._must(
            craft, reason or any(text.endswith(words) for text in row.texts), f"a reason: {after.value}"
        )

    def _rest(self, now: int) -> None:
        """After a minute without mishaps: up, around the target, nothing amiss."""
        self.rests += 1
        for craft in self.field.crafts:
            row = self._rows[craft.system][-1]
            pilot = craft.companion.pilot
            mode, said = craft.autopilot.mode, pilot.vehicle.said
            how = f"{row.phase.value}, waits for {pilot.waiting_for!r}, in {mode}: {said}"
            self._must(craft, row.phase is Phase.ESCORT and pilot.guided, f"escorts after a rest: {how}")
            self._must(craft, not row.texts, f"nothing is amiss after a rest: {sorted(row.texts)}")
            off = craft.place - self.field.target.place
            far = math.hypot(math.hypot(off[0], off[1]) - RADIUS, off[2] - CONFIG.surface.height)
            self._must(craft, far < 1.0, f"on its ring after a rest: {far:.2f} m off")

    # What the operator does

    def _listen(self) -> None:
        tower = self.field.tower
        self.texts += len(tower.received)
        self._received.extend(tower.received)
        tower.received.clear()

    def _lead(self, craft: Craft, now: int) -> None:
        """Who is down goes up again; who waits for a go gets it, if nobody is above its pad."""
        system, pilot = craft.system, craft.companion.pilot
        if not craft.autopilot.armed and craft.marks.get("flew"):
            since = self._down_since.setdefault(system, now)
            if now - since > 4 * SECOND:
                self._anew(craft)
            return
        self._down_since.pop(system, None)
        if self._is_outside(craft):
            self.note(craft, "is outside the fence without a companion that knows it: a pilot fetches it")
            self._anew(craft)
            return
        craft.marks["flew"] = craft.marks.get("flew", False) or (
            craft.autopilot.armed and craft.autopilot.airborne
        )
        waits = pilot.phase is Phase.CONNECT and pilot.waiting_for == OPERATORS_GO
        rows = self._since(craft, 20.0)
        left = len(rows) > 150 and all(row.phase is Phase.YIELDED for row in rows)
        recent = now - craft.marks.get("asked", 0) <= 2 * SECOND
        wanted = waits or (left and not craft.marks.get("taken"))
        if wanted and not recent and (craft.autopilot.airborne or self._is_free(craft)):
            craft.marks["asked"] = now
            self.field.tower.go(system)

    def _is_outside(self, craft: Craft) -> bool:
        """Whether a companion that began anew will not take it over where it hovers, for some seconds."""
        rows = self._since(craft, 5.0)
        return (
            craft.companion.pilot.waiting_for.startswith("a start near the box")
            and craft.autopilot.airborne
            and len(rows) > 40
            and all(row.phase is Phase.CONNECT for row in rows)
        )

    def _is_free(self, craft: Craft) -> bool:
        others = [other for other in self.field.crafts if other is not craft and other.autopilot.airborne]
        return all(math.hypot(*(other.place - craft.pad)[:2]) > 3.0 for other in others)

    def _anew(self, craft: Craft) -> None:
        """Back on its pad, with everything as new."""
        self.sorties += 1
        self.landings[craft.companion.pilot.phase.value] += 1
        self.note(craft, "is carried back to its pad")
        for entry in [one for one in self._running if one[2].craft is craft and not one[1].whole]:
            self._over(entry)
        craft.marks.clear()
        craft.radio.boot()
        if craft.companion.pilot.phase is Phase.DONE:
            craft.slot.start()

    # What goes wrong

    def _strike(self, seconds: float) -> None:
        for entry in [one for one in self._running if one[0] <= seconds]:
            self._over(entry)
        if seconds % (LEG + REST) >= LEG:
            for entry in list(self._running):
                self._over(entry)
        while self._plan and self._plan[0][0] <= seconds:
            _, what, number, lasts = self._plan.popleft()
            crafts = self.field.crafts
            craft = crafts[number % len(crafts)]
            if what.whole or self._rows[craft.system][-1].phase in STEERED:
                self._begin(what, craft, seconds, lasts, number)

    def _begin(self, what: Mishap, craft: Craft, seconds: float, lasts: float, number: int) -> None:
        for _, other, scene in self._running:
            if other.name == what.name and (what.whole or scene.craft is craft):
                return
            if what.begin is other.begin and scene.craft is craft:
                return
        scene = Scene(self.field, craft, Random(number), what.name)
        if what.name.startswith("told"):
            self._last_orders[craft.system] = self.field.loop.now
        self.begun[what.name] += 1
        self.note(craft, f"{what.name.upper()} for {lasts:.1f} s")
        what.begin(scene)
        self._running.append((seconds + lasts, what, scene))
        if what.sentence and what.within < lasts + 1.5:
            affected = self.field.crafts if what.whole else [craft]
            for one in affected:
                self._notice(what, one)

    def _notice(self, what: Mishap, craft: Craft) -> None:
        begun = self._rows[craft.system][-1].now
        within = what.within + 0.2

        def noticed() -> bool | None:
            rows = [row for row in self._rows[craft.system] if row.now >= begun]
            if any(text.startswith(what.sentence) for row in rows for text in row.texts):
                return True
            # On the ground nothing of a flight is a concern, and a link that is dead tells of nothing else.
            fine = all(row.phase in STEERED for row in rows)
            others = any(scene.craft is craft and m is not what for _, m, scene in self._running)
            return False if fine and not others and not self._lately(craft) else None

        self._promise(craft, within, f"noticed: {what.name}", noticed)

    def _lately(self, craft: Craft) -> bool:
        """Whether another mishap of its own ended in the last seconds."""
        return self.field.loop.now - craft.marks.get("struck", 0) < 6 * SECOND

    def _over(self, entry: tuple[float, Mishap, Scene]) -> None:
        self._running.remove(entry)
        _, what, scene = entry
        scene.craft.marks["struck"] = self.field.loop.now
        self.note(scene.craft, f"{what.name} is over")
        if what.name == "told to return":
            self._last_orders[scene.craft.system] = self.field.loop.now
        what.end(scene)
