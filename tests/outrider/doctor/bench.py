"""A doctor and some vehicles on one link, in lock-step: nobody waits, and all that was said is kept."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from mavlink_bridge.messages import CommandLong, Message, Source
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.framing import Frame, leading_frames
from mavlink_bridge.wire.signing import Signing
from outrider.doctor.consultation import Consultation
from outrider.doctor.finding import Finding, Severity, Verdict
from sitl.config.autopilot import AutopilotConfig
from sitl.node import LINK, Autopilot
from sitl.vehicle.battery import BatteryConfig
from tests.sitl.autopilot_rig import FIREFLY, SITE

TICK = 20_000
GCS = Source(255, 190)


def autopilot(
    flavour: str = "ardupilot",
    system: int = 11,
    seed: int = 1,
    signing: Signing | None = None,
    **settings: Any,
) -> Autopilot:
    """As ``outrider sitl`` has them."""
    place = {"latitude": SITE.latitude, "longitude": SITE.longitude, "altitude": SITE.altitude}
    values = {
        "system_id": system,
        "flavour": flavour,
        "streams": "normal",
        "battery": BatteryConfig(),
        "epoch": 1_700_000_000_000_000,
        **place,
        **settings,
    }
    return Autopilot(AutopilotConfig(**values), FIREFLY, SITE, seed=seed, signing=signing)


class Bench:
    """``heard``: what the doctor said, as frames. ``passes``: which frames the link lets through to it;
    ``speed``: of the vehicles' time."""

    def __init__(
        self,
        *vehicles: Autopilot,
        speed: int = 1,
        passes: Callable[[Frame], bool] = lambda _frame: True,
        boots: tuple[int, ...] = (),
    ) -> None:
        self.vehicles = vehicles
        self.boots = boots or (0,) * len(vehicles)
        self.now = 0
        self.received: list[Message] = []
        self._speed, self._passes = speed, passes
        self._mail: list[bytes] = []
        self._sender = Codec()

    def tick(self, *said: Message) -> list[bytes]:
        """20 ms (of the doctor's time); what the vehicles told."""
        mail = [*self._mail, *map(self._sender.encode, said)]
        self._mail = []
        told: list[bytes] = []
        for _ in range(self._speed):
            for boot, vehicle in zip(self.boots, self.vehicles, strict=True):
                if self.now >= boot:
                    out = vehicle.step(self.now - boot, [Datagram(LINK, data) for data in mail])
                    told += [datagram.data for datagram in out]
            mail = []
            self.now += TICK
        return told

    def run(self, seconds: float, *said: Message) -> None:
        """Let time pass before the doctor comes."""
        for _ in range(round(seconds * 1e6 / TICK)):
            self.tick(*said)
            said = ()

    def order(self, command: int, *params: float) -> None:
        """Somebody else's command, to all."""
        values = (*map(float, params), *([0.0] * 7))[:7]
        self.tick(CommandLong(GCS, 0, 0, command, 0, values))

    def consult(
        self,
        system: int | None = None,
        seconds: float = 15.0,
        *,
        beside: Callable[[int], list[bytes]] = lambda _now: [],
        until: float | None = None,
        signing: Signing | None = None,
        now: int = 0,
        baud: int | None = None,
    ) -> Verdict:
        """Until the doctor is done. ``beside``: frames of others at a time; the vehicles fall silent after
        ``until`` s. ``now``: Unix time, µs, for who signs."""
        consultation = Consultation(round(seconds * 1e6), system, signing)
        consultation.examination.baud = baud
        passed, reader = 0, Codec()
        while not consultation.over(now + passed):
            told = self.tick() if until is None or passed < until * 1e6 else []
            arrived = [
                frame.data
                for data in [*told, *beside(passed)]
                for frame in leading_frames(data)[0]
                if self._passes(frame)
            ]
            for data in consultation.step(now + passed, arrived):
                self.received += reader.feed(data)
                self._mail.append(data)
            passed += TICK
        return consultation.examination.verdict()


def found(verdict: Verdict, words: str) -> Finding:
    """The one finding whose ``what`` has these words."""
    (one,) = [finding for finding in verdict.findings if words in finding.what]
    return one


def blocking(verdict: Verdict) -> list[str]:
    """What is in the way."""
    return [finding.what for finding in verdict.of(Severity.BLOCKING)]


def warnings(verdict: Verdict) -> list[str]:
    """What can go badly."""
    return [finding.what for finding in verdict.of(Severity.WARNING)]
