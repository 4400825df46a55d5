"""One flight, as seen by the process that looks after it: it hears who is there, lets the other fly, hands
orders on, and has the last word when that ends, whatever the reason.

Where that was no order, another process follows. It flies nothing without a new go, but tells the others
where the vehicle is that holds its place among them."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Sequence
from multiprocessing.connection import wait
from pathlib import Path
from typing import Any, Final

from companion.dry_run import ONLOOKER
from companion.flight.hold_on_exit import LastWord
from companion.flight.landing import Landing
from companion.flight.readiness import OPERATORS_GO
from companion.values.components import AUTOPILOT, COMPONENT
from companion.values.phase import Phase
from mavlink_bridge.clocks.clock import WallClock
from mavlink_bridge.messages import Heartbeat, Source
from mavlink_bridge.wire.signing import Signing
from outrider.fly.child_process import Crew
from outrider.fly.event_log import Diary
from outrider.fly.hold_on_exit import farewell
from outrider.fly.identify import Identification
from outrider.fly.landing import verdict
from outrider.fly.line_input import Typed
from outrider.fly.orders import QUIT, Orders, answered, understood
from outrider.fly.process_channel import Desk, OrderLink, intercom
from outrider.fly.request import Request
from outrider.fly.status import State
from outrider.fly.watchdog import Pulse
from outrider.fly.wiring import Wiring
from outrider.fly.worker import Worker
from outrider.interruption import Came, insisted

LOOK: Final = 0.05
"""s between two looks."""
MOST: Final = 5
WITHIN: Final = 60.0
"""So many processes lost in so many seconds are the end."""
_LEAVING: Final = 2.0
"""s that it has to stop flying when it is told to."""
_QUICK: Final = 0.01


class Flight:
    """``look`` is called some times a second with the latest ``state``. ``stops``: the signals that have
    come; the first ends the flight, one that is a second later ends it at once."""

    def __init__(
        self,
        asked: Request,
        wiring: Wiring,
        directory: Path,
        diary: Diary,
        typed: Typed,
        stops: Sequence[Came],
        look: Callable[[], None],
    ) -> None:
        self.asked, self.diary = asked, diary
        self.state = State()
        self.waiting = ""
        self.figures: dict[str, Any] = {}
        self.ended = ""
        self.fault = False
        self.restarts: list[tuple[float, str]] = []
        """When (s) a process that flew was lost, and why."""
        self.last_word = ""
        self._wiring, self._directory = wiring, directory
        self._typed, self._stops, self._look = typed, stops, look
        self._wall = WallClock()
        self._signing = None if asked.key is None else Signing(asked.key)
        self._orders = Orders(asked.system, asked.config.takeoff_height, self._signing)
        self._began = time.monotonic()
        self._pulse = Pulse(self._began)
        self.landing = Landing(False, None)
        """The last, where it ended on the ground."""
        self._left = self._go_given = self._failed = self._elsewhere = False
        self._trouble = ""
        self._simulated: bool | None = None

    def run(self) -> None:
        """From the first heartbeat to the end; ``ended`` then says why, ``fault`` whether it should not
        have. InputError for an autopilot that is not the own one."""
        place = self._directory
        crew, desk, orders = self._crew(place)
        if not self._identify():
            desk.close()
            orders.release()
            return
        while True:
            self._wiring.drain()
            try:
                self.diary.note("process", f"the companion flies in process {crew.start()}")
                self._wiring.lend()
                self._left, self._pulse = False, Pulse(time.monotonic())
                self._look_after(desk, crew)
            finally:
                self._finish(desk, crew)
                # Not before: an end that nobody has open takes with it, at the next beat, what waits at ours.
                orders.release()
            if self._over():
                self.fault = self.fault or self._failed or self._elsewhere
                return
            place = self._directory / f"restart-{len(self.restarts)}"
            if self._signing is not None:
                self._signing.resume(self.state.stamp)
            if self.state.simulated is not None:
                # Found out once: the next need not be silent until it has found out again.
                self._simulated = self.state.simulated
            self.state, self.waiting = State(), ""
            crew, desk, orders = self._crew(place)

    def _crew(self, place: Path) -> tuple[Crew, Desk, OrderLink]:
        """A process that is ready to be forked, and both ends of what joins it; ``place`` gets its log."""
        desk, orders = intercom()
        wiring = self._wiring
        worker = Worker(self.asked, wiring.ends, wiring.twin, orders, place, self._simulated)
        if self._signing is not None:
            worker.resume(self._signing.newest)
        return Crew(worker), desk, orders

    @property
    def seconds(self) -> float:
        """Since the beginning."""
        return time.monotonic() - self._began

    def _identify(self) -> bool:
        endpoint, config = self.asked.endpoints["autopilot"], self.asked.config
        link = self._wiring.physical("autopilot")
        component = ONLOOKER if self.asked.dry_run else COMPONENT
        known = Identification(link, str(endpoint), Source(config.system, component), self._signing)
        while not self._over():
            beat = known.look(self._wall.now())
            if beat is not None:
                self.diary.note("heard", f"vehicle {config.system} is heard on {endpoint}")
                return True
            if known.waiting != self.waiting:
                self.waiting = known.waiting
                self.diary.note("waiting", self.waiting)
            self._obey(None)
            self._look()
            time.sleep(LOOK)
        return False

    def _look_after(self, desk: Desk, crew: Crew) -> None:
        while not self._over():
            wait([desk.fileno(), crew.sentinel], LOOK)
            desk.beat(time.monotonic())
            self._obey(desk)
            self._look()
            self._hear(desk)
            if self._left or crew.status is not None:
                ended = "gave up" if crew.status is None else f"ended with status {crew.status}"
                self._lose(f"its process {ended}")
                return
            if self._pulse.stopped(time.monotonic()):
                crew.kill()
                self._lose("its process is not heard any more")
                return
            if self.state.phase == Phase.DONE.value and not self.ended:
                landing = self.landing
                self.ended, self._elsewhere = verdict(landing.off, returning=landing.returning)

    def _over(self) -> bool:
        """Whether it is time to end; ``ended`` says why."""
        if not self.ended and self._stops:
            self.ended = f"stopped by {signal.Signals(self._stops[0].which).name}"
        if not self.ended and self.asked.seconds is not None and self.seconds >= self.asked.seconds:
            self.ended = "the time is over"
        return bool(self.ended)

    def _lose(self, why: str) -> None:
        """The process that flew is gone. Another one follows, unless they go on like that."""
        why = self._trouble or why
        self._trouble = ""
        now = self.seconds
        self.restarts.append((round(now, 2), why))
        self.diary.note("lost", f"the companion is gone: {why}")
        if len(self.restarts) >= MOST and now - self.restarts[-MOST][0] < WITHIN and not self.ended:
            self.ended, self.fault = why, True

    def _hear(self, desk: Desk) -> None:
        for news in desk.news():
            self._pulse.heard(time.monotonic())
            kind = news.pop("kind")
            if kind == "state":
                self.state = State(**news)
                self.waiting = self.state.waiting
            elif kind == "event":
                if news["what"] == "waiting":
                    self.waiting = news["text"]
                elif news["what"] == "phase":
                    self.state, self.waiting = self.state._replace(phase=news["text"]), ""
                self.diary.note(news["what"], news["text"], news["at"])
            elif kind == "ack":
                answer = answered(news["command"], news["result"], self.state.phase, self.waiting)
                self.diary.note("answer", answer)
            elif kind == "landing":
                self.landing = Landing(**news)
            elif kind == "figures":
                self.figures = news
            elif kind == "fault":
                self._trouble = news["text"]
            elif kind == "left":
                self._left = True

    def _obey(self, desk: Desk | None) -> None:
        """What was typed, and the go that a script has given beforehand. Without a ``desk`` nobody flies
        yet."""
        for line in self._typed.lines():
            word, answer = understood(line)
            if word == QUIT:
                self.ended = self.ended or "quit"
            elif word is not None:
                answer = self._refused(word, desk)
                if desk is not None and not answer:
                    self._order(word, desk)
            if answer:
                self.diary.note("answer", answer)
        ready = self.state.phase == Phase.CONNECT.value and self.waiting == OPERATORS_GO
        if desk is not None and self.asked.go and ready and not self._go_given:
            self._go_given = True
            self._order("go", desk)

    def _refused(self, word: str, desk: Desk | None) -> str:
        """Why an order is not handed on; empty if it is."""
        if self.asked.dry_run:
            return f"{word}: a dry run takes no orders; allowed: {QUIT}"
        on_the_ground = self.state.phase == Phase.CONNECT.value
        if desk is None or (word == "go" and on_the_ground and self.waiting != OPERATORS_GO):
            return f"{word}: not yet: it waits for {self.waiting}"
        return ""

    def _order(self, word: str, desk: Desk) -> None:
        if self._signing is not None:
            # As late as what the companion has heard last: its time may run faster than the wall's.
            self._signing.resume(self.state.stamp)
            self._signing.present(self._wall.now())
        self.diary.note("order", word)
        desk.order(self._orders.frame(word))

    def _finish(self, desk: Desk, crew: Crew) -> None:
        """The process that flies shall end, and then, whatever comes between, the vehicle is told to hold."""
        try:
            self._dismiss(desk, crew)
        finally:
            try:
                self._say_last_word()
            finally:
                crew.join()
        self._hear(desk)
        desk.close()

    def _dismiss(self, desk: Desk, crew: Crew) -> None:
        desk.stop()
        if crew.killed:
            crew.join()
            return
        until = time.monotonic() + _LEAVING
        while not (self._left or crew.status is not None):
            if self._at_once() or time.monotonic() > until:
                crew.kill()
                crew.join()
                self.diary.note("process", "the companion's process does not end: killed")
                return
            wait([desk.fileno(), crew.sentinel], _QUICK)
            self._hear(desk)

    def _at_once(self) -> bool:
        return insisted(self._stops)

    def _say_last_word(self) -> None:
        """Where the companion had the vehicle, ask for a hover."""
        state = self.state
        if self.asked.dry_run or state.beat is None:
            return
        beat = Heartbeat(Source(self.asked.system, AUTOPILOT), *state.beat)
        if self._signing is not None:
            self._signing.resume(state.stamp)
        word = LastWord(self.asked.system, beat, self._signing, steered=state.ours)
        farewell(word, self._wiring.ends["autopilot"], self._wall, self._at_once)
        self.last_word, self._failed = word.said, word.failed
        self.diary.note("last word", f"the vehicle: {word.said or 'asked to hold, no answer yet'}")
        if word.failed:
            self.diary.note("critical", "the vehicle is armed and nobody has it: take it over")
