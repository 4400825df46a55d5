"""What companions say on the swarm link, counted in simulated time, and what a radio has room for."""

from __future__ import annotations

import math
from collections import Counter
from itertools import pairwise
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as mavlink

from companion.config import CompanionConfig
from companion.flight.readiness import HEALTH, STREAMS
from companion.values.phase import Phase
from mavlink_bridge.errors import PlanWireError
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.key import Key
from mavlink_bridge.links.endpoints import Serial, UdpIn
from mavlink_bridge.messages import CommandLong, Source, Timesync, Tunnel
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.agreements import PAYLOAD_TYPE as AGREEMENTS
from mavlink_bridge.wire.agreements import Entry, Statement, in_messages, pack, unpack
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.signing import Signing
from outrider.errors import InputError
from outrider.onboard.link_budget import (
    FLEET,
    SHARE,
    agreed,
    carried,
    doubts,
    doubts_of_autopilot,
    reported,
    room,
    said,
    said_by_target,
    steered,
)
from outrider.scenarios.fly_config import RADIOS, FleetOrigin, FlyConfig
from sitl.config.autopilot import AutopilotConfig
from sitl.node import Autopilot
from tests.companion.avoidance.certified.plans import EPOCH
from tests.companion.avoidance.certified.rough import Habits, Rough
from tests.companion.avoidance.certified.swarm import Swarm
from tests.companion.bench import TARGET, Bench, seen_at
from tests.outrider.said import Run
from tests.outrider.shipped import FIREFLY

HERE = FleetOrigin(latitude=47.4, longitude=8.5, altitude=500.0)
FAST = FlyConfig(system=1, target=100, origin=HERE)
RADIO = FlyConfig(system=1, target=100, origin=HERE, radio=57600)
KEY = Key(b"k" * 32)
SECONDS = 8
Flavour = Literal["ardupilot", "px4"]


def weighed(bench: Bench, link: str) -> list[int]:
    """Bytes of each datagram that leaves the bench's companion by ``link`` from now on."""
    step, sizes = bench.companion.step, []

    def weighing(now, inbox):
        leaving = step(now, inbox)
        sizes.extend(len(datagram.data) for datagram in leaving if datagram.link == link)
        assert all(datagram.data[0] == 0xFD for datagram in leaving)
        return leaving

    bench.companion.step = weighing
    return sizes


def counted(config: FlyConfig, key: Key | None) -> int:
    """Bytes on the swarm link in ``SECONDS``, of a companion beside a target that flies a circle."""
    rates = config.settings.rates.model_dump() | {"replan_us": 100_000}
    bench = Bench("px4", key=key, others=key, task="escort", rates=rates)
    bench.target = seen_at(TARGET, (9.0, 0.0, 2.0))
    bench.fly(1.0)
    bench.take_off()
    sizes = weighed(bench, "swarm")
    for tick in range(100 * SECONDS):
        turn = 0.004 * tick
        place = (9.0 * math.cos(turn), 9.0 * math.sin(turn), 3.0 + math.sin(turn))
        north, east, down = 3.6 * math.cos(turn), -3.6 * math.sin(turn), -0.4 * math.cos(turn)
        bench.target = seen_at(TARGET, place, (north, east, down))._replace(source=Source(TARGET, 1))
        bench.step()
    assert bench.phase is Phase.ESCORT
    return sum(sizes)


@pytest.mark.parametrize("key", [None, KEY], ids=["plain", "signed"])
@pytest.mark.parametrize("config", [FAST, RADIO], ids=["network", "radio"])
def test_who_flies_says_what_is_stated_and_hardly_less(config: FlyConfig, key: Key | None) -> None:
    stated = SECONDS * said(config.settings, key is not None)
    # The time may begin and end with one of each kind.
    assert 0.9 * stated < counted(config, key) <= stated + 3 * 160


@pytest.mark.parametrize("signed", [False, True])
@pytest.mark.parametrize("baud", RADIOS)
def test_a_radio_carries_eight_vehicles_and_their_target(baud: int, signed: bool) -> None:
    """Bits with start and stop bit, all senders together: the bar of eight at 57 600 baud."""
    config = FlyConfig(system=1, target=100, origin=HERE, radio=baud).settings
    bits = 10 * (FLEET * said(config, signed) + said_by_target(signed))
    assert bits <= SHARE * baud
    assert carried(baud, config, signed) >= FLEET


@pytest.mark.parametrize("radio", RADIOS.values())
def test_who_misses_a_plan_still_has_the_one_before(radio) -> None:
    horizon = FAST.companion.horizon
    assert 2 * radio.plan_us < radio.plan_stale_us < (horizon.steps + 1) * horizon.dt_us


def test_plans_that_nobody_shares_take_no_room() -> None:
    silent = FAST.companion.model_copy(update={"shares_plan": False})
    assert said(silent, False) < 0.3 * said(FAST.companion, False)


@pytest.mark.parametrize("vehicles", [2, 5, 8])
def test_plans_and_statements_take_what_is_stated_and_hardly_less(vehicles: int) -> None:
    """Of vehicles in certified mode that swap places, without loss.

    What is stated at once to several vehicles may go in one message, which is less than what is counted: it
    is hardly less than what single messages would take.
    """
    turns = 2.0 * np.pi * np.arange(vehicles) / vehicles
    starts = 6.0 * np.stack([np.cos(turns), np.sin(turns), np.zeros(vehicles)], axis=1)
    swarm = Swarm(starts, Rough(delay=20_000), [Habits()] * vehicles, 1)
    seconds = 5
    swarm.run(seconds * 1_000_000, lambda _, system: -starts[system - 1])
    one = Source(1, 1)
    sizes = [len(Codec().encode(Tunnel(one, 0, 0, AGREEMENTS, payload))) for payload in swarm.sent]
    clocks = vehicles * len(Codec().encode(Timesync(one, -1, -1)))
    stated = agreed(swarm.config, False, vehicles) - clocks
    empty = len(Codec().encode(Tunnel(one, 0, 0, AGREEMENTS, pack(Statement(1, EPOCH, EPOCH)))))
    joined = empty * sum(beside_others(payload, vehicles - 1) for payload in swarm.sent)
    assert sum(sizes) / (seconds * vehicles) <= stated
    assert 0.85 * stated < (sum(sizes) + joined) / (seconds * vehicles)


def beside_others(payload: bytes, peers: int) -> int:
    """The number of changes in a payload beside the first one; 0 for plans and for statements about all."""
    try:
        entries = len(unpack(payload).entries)
    except PlanWireError:
        return 0
    whole = len(in_messages(Statement(1, EPOCH, EPOCH, (Entry(1, ((EPOCH, EPOCH),)),) * peers))[0].entries)
    return entries - 1 if 0 < entries < whole else 0


def test_more_vehicles_have_more_to_agree_on() -> None:
    config = CompanionConfig(task="goto", avoidance="certified")
    each = [said(config, False, vehicles) for vehicles in range(2, 20)]
    assert all(before < after for before, after in pairwise(each))
    # Of the field, whose plans are for all.
    assert said(FAST.settings, False, 2) == said(FAST.settings, False, 200)
    for baud in (115200, 460800, 921600):
        number = carried(baud, config, False)
        need = [n * said(config, False, n) + said_by_target(False) for n in (number, number + 1)]
        assert need[0] <= room(baud) < need[1]


@pytest.mark.parametrize("factor", [1.0, 2.5, 5.0])
def test_in_loss_plans_take_what_a_shorter_period_takes(factor: float) -> None:
    def of(**certified: float) -> CompanionConfig:
        document = {"task": "goto", "avoidance": "certified", "certified": certified}
        return CompanionConfig.model_validate(document)

    faster = of(repeat_us=50_000 / factor)
    for vehicles in (2, 8, 16):
        in_loss = said(of(repeat_in_loss=factor), False, vehicles, in_loss=True)
        assert in_loss == said(faster, False, vehicles)
        # Changes of agreements are stated once, however often plans are.
        assert in_loss <= factor * said(of(), False, vehicles)


def test_a_line_for_agreements_is_doubted_by_their_settings() -> None:
    config = CompanionConfig(task="goto", avoidance="certified")
    doubted = doubts(Serial("/dev/ttyUSB0", 460800), config, False)
    assert "companion.certified" in doubted
    vehicles = carried(460800, config, False)
    assert f"sends {said(config, False, vehicles, in_loss=True):.0f} bytes/s (repeat_in_loss)" in doubted
    with pytest.raises(InputError, match=r"too few for two vehicles.*repeat_us"):
        doubts(Serial("/dev/ttyUSB0", 57600), config, False)


def test_only_a_serial_line_is_doubted() -> None:
    assert doubts(UdpIn("127.0.0.1", 14550), FAST.settings, True) == ""
    assert doubts(Serial("/dev/ttyUSB0", 57600), RADIO.settings, True) == ""
    assert doubts(Serial("/dev/ttyUSB0", 921600), FAST.settings, True) == ""
    assert "radio: 57600" in doubts(Serial("/dev/ttyUSB0", 57600), FAST.settings, False)
    with pytest.raises(InputError, match=f"{room(9600):.0f} bytes/s"):
        doubts(Serial("/dev/ttyUSB0", 9600), FAST.settings, False)


def doubt(baud: int, config: FlyConfig = FAST, *, signed: bool = False, dry_run: bool = False) -> str:
    return doubts_of_autopilot(Serial("/dev/ttyUSB0", baud), config.settings, signed, dry_run=dry_run)


@pytest.mark.parametrize("signed", [False, True])
def test_a_slow_line_to_the_autopilot_is_doubted(signed: bool) -> None:
    assert doubt(115200, signed=signed) == ""
    narrow = doubt(57600, signed=signed)
    assert f"{reported(signed):.0f}, of 5760 bytes/s" in narrow
    assert narrow.endswith("needed: 115200 baud")
    assert f"set-points take {steered(FAST.settings, signed):.0f}" in narrow
    assert "even for a cable" in doubt(9600, signed=signed)


@pytest.mark.parametrize("signed", [False, True])
def test_a_radio_to_the_autopilot_carries_a_dry_run_beside_a_ground_station(signed: bool) -> None:
    """Nothing steers, and what is requested takes a fifth of a usual radio at most."""
    assert reported(signed, slow=True) <= 0.2 * room(57600)
    assert doubt(57600, signed=signed, dry_run=True) == ""
    narrow = doubt(9600, signed=signed, dry_run=True)
    assert f"{reported(signed, slow=True):.0f}, of 960 bytes/s" in narrow
    assert "set-points" not in narrow


def test_a_line_to_the_autopilot_is_doubted_by_what_goes_over_it() -> None:
    def rare(period: int) -> FlyConfig:
        rates = FAST.companion.rates.model_copy(update={"setpoint_us": period})
        return FAST.model_copy(update={"companion": FAST.companion.model_copy(update={"rates": rates})})

    assert doubt(57600, rare(100_000)) == ""
    assert doubt(115200, rare(10_000)).endswith("needed: 230400 baud")


def test_what_has_no_baud_rate_is_not_doubted() -> None:
    for endpoint in (UdpIn("127.0.0.1", 14550), Serial("/dev/ttyACM0", 57600)):
        assert doubts_of_autopilot(endpoint, FAST.settings, True, dry_run=False) == ""


@pytest.mark.parametrize("key", [None, KEY], ids=["plain", "signed"])
@pytest.mark.parametrize(("flavour", "estimator"), [("ardupilot", 193), ("px4", 230)])
def test_what_an_autopilot_says_is_what_is_stated(flavour: Flavour, estimator: int, key: Key | None) -> None:
    """The emulated one, asked as a companion asks."""
    config = AutopilotConfig(
        system_id=1, flavour=flavour, latitude=47.4, longitude=8.5, altitude=500.0, start_height=20.0
    )
    signing = None if key is None else Signing(key)
    autopilot = Autopilot(config, FIREFLY, FleetFrame(47.4, 8.5, 500.0), 1, signing=signing)
    asking = Codec(None, None if key is None else Signing(key))
    wanted = {**STREAMS, mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: HEALTH, estimator: HEALTH}
    wishes = [
        CommandLong(Source(1, 195), 1, 1, 511, 0, (float(number), float(each), 0.0, 0.0, 0.0, 0.0, 0.0))
        for number, each in wanted.items()
    ]
    autopilot.step(0, [Datagram("autopilot", asking.encode(wish)) for wish in wishes])
    sizes: Counter[int] = Counter()
    for tick in range(100, 100 * (SECONDS + 1)):
        for datagram in autopilot.step(10_000 * tick, []):
            data = datagram.data
            while data:
                size = 12 + data[1] + (13 if data[2] & 1 else 0)
                sizes[int.from_bytes(data[7:10], "little")] += size
                data = data[size:]
    counted = sum(sizes[number] for number in (0, *wanted))
    stated = SECONDS * reported(key is not None)
    # Zeros at a message's end are left out, and the time may begin and end with one of each kind.
    assert 0.97 * stated < counted <= stated + 300


@pytest.mark.parametrize("key", [None, KEY], ids=["plain", "signed"])
def test_what_goes_to_an_autopilot_is_what_is_stated(key: Key | None) -> None:
    bench = Bench("px4", key=key, others=key)
    bench.fly(1.0)
    bench.take_off()
    sizes = weighed(bench, "autopilot")
    bench.fly(float(SECONDS))
    assert sum(sizes) == SECONDS * steered(bench.config, key is not None)


def test_it_is_said_before_anything_is_opened(run: Run, tmp_path: Path) -> None:
    ways = ("--autopilot=udpin:127.0.0.1:0", "--config=px4", "--system=1", "--seconds=0")
    ended = run("fly", *ways, f"--swarm={tmp_path}/no-such-port,9600")
    assert (ended.status, ended.err.count("\n")) == (2, 1)
    assert "too few for two vehicles" in ended.err
    ended = run("fly", *ways, f"--swarm={tmp_path}/no-such-port,57600")
    assert ended.status == 2
    assert "enough for 2 vehicles" in ended.err.splitlines()[0]
    assert "cannot open the port" in ended.err.splitlines()[1]


@pytest.mark.parametrize("dry_run", [False, True])
def test_of_the_autopilots_line_it_is_said_too(run: Run, tmp_path: Path, dry_run: bool) -> None:
    ways = ("--swarm=udpin:127.0.0.1:0", "--config=px4", "--system=1", "--seconds=0")
    port = f"{tmp_path}/no-such-port,{9600 if dry_run else 57600}"
    ended = run("fly", *ways, f"--autopilot={port}", *(["--dry-run"] if dry_run else []))
    assert ended.status == 2
    assert f"--autopilot {port}: {'what comes back' if dry_run else 'set-points'}" in ended.err
    assert "cannot open the port" in ended.err.splitlines()[-1]


@pytest.mark.parametrize("signed", [False, True])
def test_a_radio_has_room_for_forwarded_detections(signed):
    fused = CompanionConfig.model_validate({"target_source": {"kind": "fused"}})
    config = FlyConfig(system=1, target=100, origin=HERE, radio=57600, companion=fused).settings
    more = said(config, signed) - said(RADIO.settings, signed)
    assert 20.0 < more < 60.0
    # Nobody tells the target's position on that link.
    assert FLEET * said(config, signed) <= room(57600)
