"""Supervision of one flight by the parent process.

The parent identifies the autopilot, starts the child that flies, and forwards orders to it. When a child that
controlled the vehicle ends, for whatever reason, the parent asks the autopilot to hold.

If the child ends unasked, another child follows, unless ``MOST`` children were lost within ``WITHIN``
seconds. The new child does not fly without a new go, but shares the position of the holding vehicle with the
other companions.
"""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Sequence
from multiprocessing.connection import wait
from pathlib import Path
from typing import Any, Final

from pymavlink.dialects.v20 import all as mavlink

from companion.dry_run import ONLOOKER
from companion.flight.hold_on_exit import HoldOnExit
from companion.flight.landing import Landing
from companion.flight.readiness import OPERATORS_GO
from companion.values.components import COMPONENT
from companion.values.phase import Phase
from mavlink_bridge.messages import Heartbeat, Source
from mavlink_bridge.wire.signing import Signing
from outrider.interruption import ReceivedSignal, insisted
from outrider.onboard.backup import Backup
from outrider.onboard.backup_worker import KEPT
from outrider.onboard.child_process import ChildProcess
from outrider.onboard.clocks import CompanionClock
from outrider.onboard.event_log import EventLog
from outrider.onboard.hold_on_exit import farewell
from outrider.onboard.identify import Identification
from outrider.onboard.landing import verdict
from outrider.onboard.line_input import LineInput
from outrider.onboard.orders import QUIT, Orders, answered, understood
from outrider.onboard.process_channel import Channel, OrderLink, intercom
from outrider.onboard.request import Request
from outrider.onboard.status import State
from outrider.onboard.watchdog import HUNG, Watchdog
from outrider.onboard.wiring import Wiring
from outrider.onboard.worker import Worker

LOOK: Final = 0.05
"""Longest time between two polls (s)."""
MOST: Final = 5
WITHIN: Final = 60.0
"""``MOST`` processes lost within ``WITHIN`` seconds end the flight."""
_STOP_TIMEOUT_S: Final = 2.0
"""Time limit for the child to stop flying after the stop request (s)."""
_FINISH_TIMEOUT_S: Final = 8.0
"""The same with committed plans, which are flown to their end (s)."""
HUNG_CERTIFIED_S: Final = 6.0
"""Time without a message after which a companion with a committed plan counts as hung (s).

Its backup node flies the plan to the end meanwhile, so there is time for it to return.
"""
_STOP_POLL_S: Final = 0.01


class Flight:
    """Supervisor of one flight.

    ``look`` is called about 20 times a second. ``state``: the latest state that the child reported.
    ``stops``: the signals received so far. The first ends the flight; after another one, at least a second
    after the first, the child is killed at once.
    """

    def __init__(
        self,
        asked: Request,
        wiring: Wiring,
        directory: Path,
        event_log: EventLog,
        typed: LineInput,
        stops: Sequence[ReceivedSignal],
        look: Callable[[], None],
    ) -> None:
        self.asked, self.event_log = asked, event_log
        self.state = State()
        self.waiting = ""
        self.figures: dict[str, Any] = {}
        self.ended = ""
        self.fault = False
        self.restarts: list[tuple[float, str]] = []
        """Times (s) at which a flying process was lost, with the reasons."""
        self.last_word = ""
        self._wiring, self._directory = wiring, directory
        self._typed, self._stops, self._look = typed, stops, look
        self._clock = CompanionClock(asked.config.clock_error)
        self._wall = self._clock.clock
        self._signing = None if asked.key is None else Signing(asked.key)
        self._orders = Orders(asked.system, asked.config.takeoff_height, self._signing)
        self._began = time.monotonic()
        self._watchdog = Watchdog(self._began)
        self.landing = Landing(False, None)
        """Last landing; before the first, one without a return and with an unknown position."""
        self._left = self._go_given = self._failed = self._elsewhere = False
        self._trouble = ""
        self._simulated: bool | None = None
        self._certified = asked.config.certified
        self._backup: Backup | None = None
        self.carried = 0
        """Number of set-points that backup nodes have sent in the companion's place."""

    def run(self) -> None:
        """Run the flight from the first heartbeat to the end.

        Afterwards ``ended`` gives the reason, ``fault`` whether it is a fault. Raises InputError if the
        autopilot is not the own vehicle's or not supported.
        """
        place = self._directory
        child, desk, orders = self._child(place)
        if not self._identify():
            desk.close()
            orders.release()
            if self._backup is not None:
                self._backup.close()
            return
        while True:
            self._wiring.drain()
            try:
                if self._backup is not None:
                    # Before the companion: the backup node has to know the first plan that is flown.
                    self._backup.start()
                self.event_log.note("process", f"the companion flies in process {child.start()}")
                self._wiring.lend(() if self._backup is None else KEPT)
                if self._backup is not None:
                    self._backup.release()
                hung = HUNG_CERTIFIED_S if self._certified else HUNG
                self._left, self._watchdog = False, Watchdog(time.monotonic(), hung)
                self._look_after(desk, child)
            finally:
                self._finish(desk, child)
                # The child's end of the channel is closed only now: when no process has it open, the parent's
                # next send fails and the kernel discards the messages that wait at the parent's end.
                orders.release()
            if self._over():
                self.fault = self.fault or self._failed or self._elsewhere
                return
            if self._certified:
                # So the next process plans no epoch of which this one may have announced a plan.
                time.sleep(2e-6 * self.asked.config.companion.certified.epoch_us)
            place = self._directory / f"restart-{len(self.restarts)}"
            if self._signing is not None:
                self._signing.resume(self.state.stamp)
            if self.state.simulated is not None:
                # The kind of clock is known from the previous process: the next one need not identify it
                # before it sends.
                self._simulated = self.state.simulated
            self.state, self.waiting = State(), ""
            child, desk, orders = self._child(place)

    def _child(self, place: Path) -> tuple[ChildProcess, Channel, OrderLink]:
        """Return a process ready to fork, and both ends of its channel; its log goes to ``place``."""
        desk, orders = intercom()
        wiring, copies = self._wiring, None
        if self._certified:
            self._backup = Backup(
                self.asked, wiring, self._wall, lambda: self.state.stamp, self.event_log.note, place
            )
            copies = self._backup.copies
        worker = Worker(
            self.asked, wiring.ends, wiring.duplicates, orders, place, self._simulated, self._clock, copies
        )
        if self._signing is not None:
            worker.resume(self._signing.newest)
        return ChildProcess(worker), desk, orders

    @property
    def seconds(self) -> float:
        """Time since the beginning (s)."""
        return time.monotonic() - self._began

    def _identify(self) -> bool:
        endpoint, config = self.asked.endpoints["autopilot"], self.asked.config
        link = self._wiring.physical("autopilot")
        component = ONLOOKER if self.asked.dry_run else COMPONENT
        known = Identification(link, str(endpoint), Source(config.system, component), self._signing)
        while not self._over():
            beat = known.look(self._wall.now())
            if beat is not None:
                self.event_log.note("heard", f"vehicle {config.system} is heard on {endpoint}")
                return True
            if known.waiting != self.waiting:
                self.waiting = known.waiting
                self.event_log.note("waiting", self.waiting)
            self._obey(None)
            self._look()
            time.sleep(LOOK)
        return False

    def _look_after(self, desk: Channel, child: ChildProcess) -> None:
        while not self._over():
            wait([desk.fileno(), child.sentinel], LOOK)
            desk.beat(time.monotonic())
            self._obey(desk)
            self._look()
            self._receive(desk)
            if self._backup is not None:
                self._wiring.release_unplugged()
                self._backup.look()
            if self._left or child.status is not None:
                ended = "gave up" if child.status is None else f"ended with status {child.status}"
                self._lose(f"its process {ended}")
                return
            if self._watchdog.stopped(time.monotonic()):
                child.kill()
                self._lose("its process sends no more messages")
                return
            if self.state.phase == Phase.DONE.value and not self.ended:
                landing = self.landing
                self.ended, self._elsewhere = verdict(landing.off, returning=landing.returning)

    def _over(self) -> bool:
        """Return whether the flight is over; set ``ended`` to the reason after a signal or the time limit."""
        if not self.ended and self._stops:
            self.ended = f"stopped by {signal.Signals(self._stops[0].which).name}"
        if not self.ended and self.asked.seconds is not None and self.seconds >= self.asked.seconds:
            self.ended = "the time is over"
        return bool(self.ended)

    def _lose(self, why: str) -> None:
        """Record the loss of the flying process; end the flight if too many were lost recently."""
        why = self._trouble or why
        self._trouble = ""
        now = self.seconds
        self.restarts.append((round(now, 2), why))
        self.event_log.note("lost", f"the companion is gone: {why}")
        if len(self.restarts) >= MOST and now - self.restarts[-MOST][0] < WITHIN and not self.ended:
            self.ended, self.fault = why, True

    def _receive(self, desk: Channel) -> None:
        for news in desk.news():
            self._watchdog.received(time.monotonic())
            kind = news.pop("kind")
            if kind == "state":
                self.state = State(**news)
                self.waiting = self.state.waiting
            elif kind == "event":
                if news["what"] == "waiting":
                    self.waiting = news["text"]
                elif news["what"] == "phase":
                    self.state, self.waiting = self.state._replace(phase=news["text"]), ""
                self.event_log.note(news["what"], news["text"], news["at"])
            elif kind == "ack":
                answer = answered(news["command"], news["result"], self.state.phase, self.waiting)
                self.event_log.note("answer", answer)
            elif kind == "landing":
                self.landing = Landing(**news)
            elif kind == "figures":
                self.figures = news
            elif kind == "fault":
                self._trouble = news["text"]
            elif kind == "left":
                self._left = True

    def _obey(self, desk: Channel | None) -> None:
        """Execute typed orders, and the option ``--go`` as soon as the companion waits for it.

        ``desk`` is None while no process flies yet.
        """
        for line in self._typed.lines():
            word, answer = understood(line)
            if word == QUIT:
                self.ended = self.ended or "quit"
            elif word is not None:
                answer = self._refused(word, desk)
                if desk is not None and not answer:
                    self._order(word, desk)
            if answer:
                self.event_log.note("answer", answer)
        ready = self.state.phase == Phase.CONNECT.value and self.waiting == OPERATORS_GO
        if desk is not None and self.asked.go and ready and not self._go_given:
            self._go_given = True
            self._order("go", desk)

    def _refused(self, word: str, desk: Channel | None) -> str:
        """Return why an order is not forwarded; empty if it is forwarded."""
        if self.asked.dry_run:
            return f"{word}: a dry run takes no orders; allowed: {QUIT}"
        on_the_ground = self.state.phase == Phase.CONNECT.value
        if desk is None or (word == "go" and on_the_ground and self.waiting != OPERATORS_GO):
            return f"{word}: not yet: it waits for {self.waiting}"
        return ""

    def _order(self, word: str, desk: Channel) -> None:
        if self._signing is not None:
            # Not older than the newest stamp of the companion: a simulation's time may be ahead of the wall
            # clock.
            self._signing.resume(self.state.stamp)
            self._signing.present(self._wall.now())
        self.event_log.note("order", word)
        desk.order(self._orders.frame(word))

    def _finish(self, desk: Channel, child: ChildProcess) -> None:
        """End the flying process; then ask the autopilot to hold, even after an exception."""
        try:
            self._dismiss(desk, child)
        finally:
            try:
                self._say_last_word()
            finally:
                child.join()
                if self._backup is not None:
                    self._backup.close()
                    self.carried += self._backup.carried
                    self._backup = None
        self._receive(desk)
        desk.close()

    def _dismiss(self, desk: Channel, child: ChildProcess) -> None:
        desk.stop()
        if child.killed:
            child.join()
            return
        # In certified flight the companion first flies its plan to the end.
        until = time.monotonic() + (_FINISH_TIMEOUT_S if self._certified else _STOP_TIMEOUT_S)
        while not (self._left or child.status is not None):
            if self._at_once() or time.monotonic() > until:
                child.kill()
                child.join()
                self.event_log.note("process", "the companion's process does not end: killed")
                return
            wait([desk.fileno(), child.sentinel], _STOP_POLL_S)
            self._receive(desk)
            if self._certified:
                desk.beat(time.monotonic())
                self._look()

    def _at_once(self) -> bool:
        return insisted(self._stops)

    def _say_last_word(self) -> None:
        """Ask the autopilot to hold, if the companion was in control."""
        state = self.state
        if self.asked.dry_run or state.beat is None:
            return
        if self._backup is not None and (end := self._backup.relieve(self._look)) is not None:
            self.last_word, self._failed = end.said, end.failed
            self._report_last_word()
            return
        beat = Heartbeat(Source(self.asked.system, mavlink.MAV_COMP_ID_AUTOPILOT1), *state.beat)
        if self._signing is not None:
            self._signing.resume(state.stamp)
        word = HoldOnExit(self.asked.system, beat, self._signing, steered=state.ours)
        farewell(word, self._wiring.ends["autopilot"], self._wall, self._at_once)
        self.last_word, self._failed = word.said, word.failed
        self._report_last_word()

    def _report_last_word(self) -> None:
        self.event_log.note("last word", f"the vehicle: {self.last_word or 'asked to hold, no answer yet'}")
        if self._failed:
            self.event_log.note("critical", "the vehicle is armed and nothing controls it: take it over")
