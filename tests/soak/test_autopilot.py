"""Damaged and absurd messages into a whole autopilot in flight: nothing raises, every number stays finite,
the reference within its limits, and good messages that follow are answered."""

from __future__ import annotations

from random import Random

import numpy as np

from mavlink_bridge.messages import CommandAck, CommandInt, CommandLong, Ping, SetpointLocal, Timesync
from mavlink_bridge.wire.codec import Codec
from tests.sitl.autopilot_rig import ALL, PILOT, POSITION_YAW, Rig, setpoint
from tests.soak.campaigns import Mutants
from tests.soak.corpora import GROUND, frames, messages
from tests.soak.damage import WIRE_EDITS, absurd, damaged

OTHERS = frames(messages())
OBEYED = CommandInt | CommandLong | SetpointLocal | Ping | Timesync
HEARD = [one for one in messages() if isinstance(one.message, OBEYED) or one.message.source == GROUND]
HEIGHT = 20.0
UNSUPPORTED, UNHEARD_OF = 3, 31_000


def data_of(random: Random) -> bytes:
    """A frame or some, mostly of what an autopilot obeys."""
    chosen = b"".join(
        absurd(random, random.choice(frames([random.choice(HEARD)]))) for _ in range(random.choice((1, 1, 3)))
    )
    if random.random() < 0.1:
        chosen += random.choice(OTHERS)
    return damaged(random, chosen, OTHERS, WIRE_EDITS) if random.random() < 0.3 else chosen


def check_flight(rig: Rig) -> None:
    """Every number is finite, and the reference within the limits."""
    autopilot, config = rig.autopilot, rig.config
    state, estimate = autopilot.state, autopilot.estimate
    for part in (state.position, state.velocity, autopilot.trace, estimate.position, estimate.velocity):
        assert np.isfinite(part).all()
    reference = autopilot.reference
    if reference is not None:
        assert np.linalg.norm(reference.velocity) <= 1.05 * config.max_speed
        assert np.linalg.norm(reference.acceleration) <= 1.05 * config.max_acceleration
        assert all(np.isfinite(part).all() for part in reference)


def test_whatever_is_ordered_the_autopilot_flies_on(mutants: Mutants) -> None:
    for session in mutants.sessions():
        number = session[0].index
        flavour, sensors = ("ardupilot", "px4")[number % 2], ("truth", "rtk")[number // 2 % 2]
        rig = Rig(flavour, start_height=HEIGHT, sensors=sensors)
        rig.run(0.1, setpoint(POSITION_YAW, (0.0, 0.0, -HEIGHT)))
        rig.guided()
        for mutant in session:
            with mutant:
                rig.step_bytes(data_of(mutant.random))
                check_flight(rig)
                rig.run(mutant.random.choice((0.01, 0.02, 0.1)))
                check_flight(rig)
                if mutant.random.random() < 0.3:
                    rig.step(setpoint(ALL, (0.0, 0.0, -HEIGHT)))
                    rig.guided()
        with session[-1]:
            reader = Codec()
            reader.feed(rig.bytes)
            assert reader.counters[1:] == (0, 0, 0, 0, 0)
            order = CommandLong(PILOT, 11, 1, UNHEARD_OF, 0, (0.0,) * 7)
            rig.step(order, Ping(PILOT, 7, 19, 0, 0))
            assert rig.all(CommandAck)[-1][1:3] == (UNHEARD_OF, UNSUPPORTED)
            assert rig.all(Ping)[-1].sequence == 19
            rig.run(2.0)
            check_flight(rig)
