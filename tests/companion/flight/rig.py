"""A pilot that is told messages and asked for its commands, tick by tick."""

from __future__ import annotations

import numpy as np
from pymavlink.dialects.v20 import all as mavlink

from companion.config import CompanionConfig
from companion.estimation.tracks import State
from companion.flight.state_machine import Pilot
from companion.values.phase import Phase
from companion.world import View
from mavlink_bridge.messages import CommandAck, ExtendedSysState, Heartbeat, Message, Source, SysStatus
from tests.companion.bench import AUTOPILOT, FLEET, PROFILES, START, TICK

OWN = Source(11, 195)
HEIGHT, GROUND = 6.0, 2.5
HALF = 500_000
LOCAL = FLEET.local(FLEET.latitude, FLEET.longitude, FLEET.altitude)
IN_FLIGHT = ExtendedSysState(AUTOPILOT, 0, 2)
_CHECKS = mavlink.MAV_SYS_STATUS_PREARM_CHECK
HEALTHY = SysStatus(AUTOPILOT, _CHECKS, _CHECKS, _CHECKS, None, None)
ILL = SysStatus(AUTOPILOT, _CHECKS, _CHECKS, 0, None, None)


def state(height=0.0, speed=0.0, age=5_000):
    return State(np.array([0.0, 0.0, GROUND + height]), np.array([0.0, 0.0, speed]), age)


def beat(flavour, armed=False, guided=False, autopilot=None, mode=0):
    profile = PROFILES[flavour]
    mode = profile.guided_custom_mode if guided else mode
    kind = profile.autopilot if autopilot is None else autopilot
    return Heartbeat(AUTOPILOT, 2, kind, mavlink.MAV_MODE_FLAG_SAFETY_ARMED * armed, mode, 4)


def ack(command, result=0):
    return CommandAck(AUTOPILOT, command, result, 0, 0, *OWN)


def landed(state_of_landing):
    return ExtendedSysState(AUTOPILOT, 0, state_of_landing)


NOTHING = View(None, None, None, None)
READY = View(state(), 0.3, None, LOCAL)


class Rig:
    """A pilot, the time, and what it sees and has sent."""

    def __init__(self, flavour="ardupilot", view=READY):
        self.flavour = flavour
        self.pilot = Pilot(CompanionConfig(), OWN, FLEET.altitude)
        self.now, self.view = START, view
        self.sent = []

    def tick(self, *received: Message):
        """One step: the commands sent, as (command, parameters without NaN)."""
        for message in received:
            # As a codec makes it: a new one each time.
            self.pilot.receive(message._replace())
        sent = [
            (m.command, tuple(p for p in m.params if p == p)) for m in self.pilot.step(self.now, self.view)
        ]
        self.sent += [(self.now, *call) for call in sent]
        self.now += TICK
        return sent

    def run(self, seconds, *every, acks=False):
        """Steps; with ``acks`` every command is accepted at once."""
        sent, answers = [], []
        for _ in range(round(seconds * 1e6 / TICK)):
            new = self.tick(*every, *answers)
            answers = [ack(command) for command, _ in new] if acks else []
            sent += new
        return sent

    def prepared(self):
        """Connected, given the go, intervals asked for."""
        self.run(0.2, beat(self.flavour), HEALTHY, acks=True)
        assert self.pilot.go(HEIGHT)
        self.tick()
        assert self.pilot.phase is Phase.PREPARE
        return self

    def escorting(self):
        self.prepared()
        self.view = READY._replace(own=state(HEIGHT))
        self.run(0.2, beat(self.flavour, armed=True, guided=True))
        assert self.pilot.phase is Phase.ESCORT
        return self
