"""What the doctor says of the estimator's flags."""

from __future__ import annotations

import pytest

from mavlink_bridge.messages import EkfStatus, EstimatorStatus, Heartbeat, Source
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.framing import Framer
from outrider.doctor.case import Case
from outrider.doctor.finding import Severity
from outrider.doctor.hearing import Hearing
from outrider.doctor.positioning import estimator

ME = Source(1, 1)
ABSOLUTE, AMBIGUOUS = 0x10, 0x400


def case(autopilot: int, flags: int) -> Case:
    hearing, codec = Hearing(), Codec()
    ratios = (0.1,) * 8
    told = EstimatorStatus(ME, 1, *ratios, flags) if autopilot == 12 else EkfStatus(ME, flags)
    for message in (Heartbeat(ME, 2, autopilot, 0x81, 4, 4), told):
        for frame in Framer().feed(codec.encode(message)):
            hearing.receive(1_000_000, frame)
    return Case(hearing, hearing.senders[ME], log=True, me=None)


@pytest.mark.parametrize(
    ("autopilot", "flags", "severity"),
    [
        pytest.param(3, ABSOLUTE, Severity.OK, id="ArduPilot"),
        pytest.param(3, ABSOLUTE | AMBIGUOUS, Severity.BLOCKING, id="ArduPilot, not initialised"),
        pytest.param(12, ABSOLUTE, Severity.OK, id="PX4"),
        pytest.param(12, ABSOLUTE | AMBIGUOUS, Severity.OK, id="PX4 with a GPS glitch"),
    ],
)
def test_one_bit_has_two_meanings(autopilot: int, flags: int, severity: Severity) -> None:
    (finding,) = estimator(case(autopilot, flags))
    assert finding.severity is severity
