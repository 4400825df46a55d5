"""Damaged logs: only LogError comes out, every record is sound, every byte is accounted for, and the good end
of a log is read whatever came before."""

from __future__ import annotations

import gzip
import json
from itertools import pairwise
from pathlib import Path

from mavlink_bridge.errors import LogError
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import Heartbeat, Source
from mavlink_bridge.tlog.log import LINKS, Record, TlogReader, read_tlog
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.framing import LONGEST_FRAME, Flaw, frame_at
from outrider.errors import InputError
from outrider.logs.listing import document
from outrider.logs.tally import count
from outrider.scenarios.places import RecordedTarget
from outrider.simulation.targets import load
from tests.soak.campaigns import Mutant, Mutants
from tests.soak.corpora import frames as frames_of
from tests.soak.corpora import log, logs, messages
from tests.soak.damage import EDITS, WIRE_EDITS, absurd, damaged

LOGS = logs()
FRAMES = frames_of(messages())
FLEET = FleetFrame(-35.3622913, 149.1656747, 590.0)
WANTED = RecordedTarget(kind="recorded", log="any", system=1, start_s=0.0, duration_s=60.0)
GOOD = [Codec().encode(Heartbeat(Source(77, 1), 2, 3, 0, number, 4)) for number in range(60)]
END = log(GOOD, len(GOOD))
LATE = GOOD[LONGEST_FRAME // len(GOOD[0]) + 2 :]


def mutated(mutant: Mutant, folder: Path) -> tuple[Path, bytes]:
    """A damaged log, plain or compressed, or one that was damaged first and compressed then."""
    random = mutant.random
    data = random.choice(LOGS)
    if random.random() < 0.3:
        chosen = [absurd(random, random.choice(FRAMES)) for _ in range(40)]
        data = log(chosen, len(chosen))
    data = damaged(random, data, (*LOGS, *FRAMES), random.choice((EDITS, WIRE_EDITS)))
    if random.random() < 0.15:
        data = gzip.compress(data, 1)
        data = data[: random.choice((len(data), random.randrange(len(data))))]
    path = folder / "mutant.tlog"
    path.write_bytes(data)
    return path, data


def records_of(reader: TlogReader) -> list[Record]:
    found = list(reader)
    assert reader.report.good == len(found)
    for record in found:
        assert record.time % 4 == 0
        assert 0 <= record.link < LINKS
        frame = frame_at(record.frame, 0)
        assert not isinstance(frame, Flaw)
        assert frame.known
        assert len(frame.data) == len(record.frame) <= LONGEST_FRAME
    return found


def test_any_file_is_records_and_a_report(mutants: Mutants, tmp_path: Path) -> None:
    for mutant in mutants:
        with mutant:
            path, data = mutated(mutant, tmp_path)
            try:
                reader = read_tlog(path)
            except LogError:
                continue
            found = records_of(reader)
            assert list(reader) == found
            report = reader.report
            times = [record.time for record in found]
            assert report.time_steps_back == sum(later < earlier for earlier, later in pairwise(times))
            assert reader.bytes_read <= len(data)
            frames = sum(len(record.frame) for record in found)
            # A frame without a stamp of its own takes no eight bytes.
            assert frames <= reader.record_bytes
            assert reader.record_bytes - frames <= (8 + LONGEST_FRAME) * report.unknown + 8 * len(found)
            if data[:2] != b"\x1f\x8b":
                assert reader.record_bytes + report.skipped_bytes == reader.bytes_read == len(data)


def test_the_census_of_any_file_is_that_of_its_records(mutants: Mutants, tmp_path: Path) -> None:
    for mutant in mutants:
        with mutant:
            path, _ = mutated(mutant, tmp_path)
            census = count(path, lambda _share: None)
            try:
                reader = read_tlog(path)
            except LogError:
                assert census is None
                continue
            records = list(reader)
            assert census is not None
            assert census.report == reader.report
            assert sum(vehicle.messages for vehicle in census.vehicles) == len(records)
            assert (census.start, census.end) == (min(r.time for r in records), max(r.time for r in records))
            said = json.dumps(document(census))
            assert "NaN" not in said
            assert "Infinity" not in said


def test_the_good_end_of_a_log_is_read(mutants: Mutants, tmp_path: Path) -> None:
    """Whatever is claimed before it ends within the longest frame."""
    for mutant in mutants:
        with mutant:
            path, data = mutated(mutant, tmp_path)
            path.write_bytes(data + END)
            if data[:2] == b"\x1f\x8b":
                path.write_bytes(gzip.compress(data + END, 1))
            found = records_of(read_tlog(path))
            assert [record.frame for record in found][-len(LATE) :] == LATE


def test_a_recorded_target_flies_or_is_refused(mutants: Mutants, tmp_path: Path) -> None:
    for mutant in mutants:
        with mutant:
            path, _ = mutated(mutant, tmp_path)
            try:
                recording = load(WANTED, path, FLEET)
            except InputError:
                continue
            assert len(recording.times) == len(recording.frames) == len(recording.positions) > 1
            assert (recording.times[1:] >= recording.times[:-1]).all()
            assert (abs(recording.positions) < 2e7).all()
