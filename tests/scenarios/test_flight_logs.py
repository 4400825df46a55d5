"""What a flight leaves in its logs can be read back, by us and by others, and is what was flown."""

from __future__ import annotations

import numpy as np
import pytest
from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega

from mavlink_bridge.messages import SetpointLocal
from mavlink_bridge.tlog.log import read_tlog
from mavlink_bridge.wire.codec import Codec
from outrider.runs.names import LINK_NUMBERS
from outrider.scenarios.scenario import TARGET_SYSTEM
from outrider.simulation.flight import EPOCH
from tests.scenarios.lockstep_flights import Flown, check, fly, scenario, setpoints

OPERATOR = 255
LINKS = {number: name for name, number in LINK_NUMBERS.items()}


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Flown:
    return fly(scenario("antipodal-8", {"vehicles": 2, "flavour": "px4"}), 4, tmp_path_factory.mktemp("logs"))


def test_it_was_a_flight(flown: Flown) -> None:
    check(flown)
    logs = sorted(path.name for path in flown.directory.glob("*.tlog"))
    assert logs == [path.name for path in flown.logs]


def test_every_byte_is_read_back(flown: Flown) -> None:
    for path in flown.logs:
        log = read_tlog(path)
        records = list(log)
        report = log.report
        assert report.good == len(records) > 1_000
        assert report._replace(good=0) == (0, 0, 0, 0, 0, False)
        codec = Codec()
        for record in records:
            codec.feed(record.frame)
        assert (codec.counters.bad, codec.counters.skipped_bytes, codec.pending_bytes) == (0, 0, 0)
        assert sum(8 + len(record.frame) for record in records) == path.stat().st_size
        times = np.array([record.time for record in records])
        assert (np.diff(times) >= 0).all()
        assert times[0] >= EPOCH
        assert (times % 4 == 0).all()


def test_the_generated_dialect_reads_every_frame(flown: Flown) -> None:
    parser = ardupilotmega.MAVLink(None)
    for path in flown.logs:
        names = {parser.decode(bytearray(record.frame)).get_type() for record in read_tlog(path)}
        assert not any(name.startswith(("UNKNOWN", "BAD_DATA")) for name in names)
        assert {"HEARTBEAT", "LOCAL_POSITION_NED", "SET_POSITION_TARGET_LOCAL_NED", "TUNNEL"} <= names


def test_pymavlink_s_log_reader_sees_the_same(flown: Flown) -> None:
    for path in flown.logs:
        records = list(read_tlog(path))
        reader = mavutil.mavlink_connection(str(path), dialect="ardupilotmega")
        try:
            seen = []
            while (message := reader.recv_match()) is not None:
                seen.append((round(message._timestamp * 1e6), message.get_msgId(), message.get_srcSystem()))
        finally:
            reader.close()
        assert [identifier for _, identifier, _ in seen] == [identifier_of(r.frame) for r in records]
        assert [system for *_, system in seen] == [r.frame[5] for r in records]
        assert max(abs(time - r.time) for (time, *_), r in zip(seen, records, strict=True)) < 4


def identifier_of(frame: bytes) -> int:
    """Message id of a MAVLink 2 frame."""
    assert frame[0] == 0xFD
    return int.from_bytes(frame[7:10], "little")


def test_links_tell_who_spoke_where(flown: Flown) -> None:
    everyone = set(flown.flight.systems)
    for own, path in zip(flown.flight.systems, flown.logs, strict=True):
        spoke: dict[str, set[int]] = {}
        carried: dict[str, set[int]] = {}
        for record in read_tlog(path):
            spoke.setdefault(LINKS[record.link], set()).add(record.frame[5])
            carried.setdefault(LINKS[record.link], set()).add(identifier_of(record.frame))
        assert spoke == {
            "autopilot": {own},
            "swarm": everyone,
            "target": {TARGET_SYSTEM},
            "ground": {own, OPERATOR},
        }
        assert [name for name, found in carried.items() if 84 in found] == ["autopilot"]
        assert [name for name, found in carried.items() if 385 in found] == ["swarm"]
        assert carried["ground"] == {75, 76, 77}


def test_what_one_hears_is_what_the_other_said(flown: Flown) -> None:
    said: dict[int, set[bytes]] = {}
    received: dict[int, set[bytes]] = {}
    for own, path in zip(flown.flight.systems, flown.logs, strict=True):
        for record in read_tlog(path):
            if LINKS[record.link] == "swarm":
                who = said if record.frame[5] == own else received
                who.setdefault(record.frame[5], set()).add(record.frame)
    for system in flown.flight.systems:
        # All but what was under way when the flight ended.
        assert received[system] <= said[system]
        assert len(said[system] - received[system]) <= 2


def test_setpoints_flow_evenly_and_without_jumps(flown: Flown) -> None:
    limits = flown.flight.scenario.companion.limits
    period = flown.flight.scenario.companion.rates.setpoint_us * 1e-6
    assert flown.summary["anchored_anew"] == 0
    for path in flown.logs:
        sent = setpoints(path)
        times = np.array([message.time_boot for message in sent]) * 1e-6
        gaps = np.diff(times)
        # Before OFFBOARD they stream; a break only ends a stream.
        assert (gaps > 0.0).all()
        assert np.median(gaps) == pytest.approx(period, abs=1e-3)
        steps = np.diff([message.position for message in sent], axis=0)
        fastest = float(np.linalg.norm(limits.v_max))
        assert (np.linalg.norm(steps, axis=1) <= 1.1 * fastest * gaps + 0.02).all()


def test_the_vehicles_were_where_their_setpoints_said(flown: Flown) -> None:
    flight = flown.flight
    samples = flight.truth.samples(flight.conductor.clock_start or 0, flight.conductor.clock_end)
    for k, path in enumerate(flown.logs):
        times, places = [], []
        codec = Codec(lambda identifier, _system, _component: identifier == 84)
        for record in read_tlog(path):
            for message in codec.feed(record.frame):
                assert isinstance(message, SetpointLocal)
                north, east, down = message.position
                times.append(record.time)
                places.append((east, north, -down))
        start = flight.fleet.starts.positions[k] * (1.0, 1.0, 0.0)
        said = np.column_stack([np.interp(samples.time, times, axis) for axis in np.array(places).T]) + start
        off = np.linalg.norm(said - samples.position[:, k], axis=1)
        assert np.percentile(off, 95) < 0.6
        assert off.max() < 1.5
