"""Cut a stretch of one message out of a tlog, every record byte for byte as it was.

    .venv/bin/python tools/extract_log.py INPUT OUTPUT --message GLOBAL_POSITION_INT --start 475 --duration 70

``--start`` and ``--duration`` are s of receive time from the log's first record on; one vehicle is kept.
The stretch that ships, and what is to be known of it, stand in the README beside it.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from pymavlink.dialects.v20 import ardupilotmega

from mavlink_bridge.errors import LogError
from mavlink_bridge.framing import Frame, frame_at
from mavlink_bridge.tlog import Record, TlogWriter, read_tlog


def message_id(name: str) -> int:
    """The number of a message of the dialect. Raises argparse.ArgumentTypeError for a name that it lacks."""
    for number, message in ardupilotmega.mavlink_map.items():
        if message.msgname == name:
            return int(number)
    raise argparse.ArgumentTypeError(f"{name!r} is no message of the ardupilotmega dialect")


def stretch(source: Path, message: int, system: int, start_s: float, duration_s: float) -> list[Record]:
    """The records of ``message`` from ``system`` in [start, start + duration), in the order of the log."""
    kept = []
    first: int | None = None
    for record in read_tlog(source):
        if first is None:
            first = record.time
        if not start_s <= (record.time - first) / 1e6 < start_s + duration_s:
            continue
        frame = frame_at(record.frame, 0)
        if isinstance(frame, Frame) and (frame.message_id, frame.system) == (message, system):
            kept.append(record)
    return kept


def main() -> int:
    """The command line; the exit status is 2 if the log cannot be read or nothing of it is kept."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("input", type=Path)
    parser.add_argument("output", type=Path)
    parser.add_argument("--message", type=message_id, required=True, metavar="NAME")
    parser.add_argument("--system", type=int, default=1, help="system id of the vehicle (default 1)")
    parser.add_argument("--start", type=float, required=True, help="s after the first record")
    parser.add_argument("--duration", type=float, required=True, help="s")
    given = parser.parse_args()
    try:
        kept = stretch(given.input, given.message, given.system, given.start, given.duration)
        if not kept:
            raise LogError(f"{given.input}: holds no such message in that stretch")
        with TlogWriter(given.output) as log:
            for record in kept:
                log.write(record.time, record.link, record.frame)
    except LogError as error:
        sys.stderr.write(f"{error}\n")
        return 2
    span = (kept[-1].time - kept[0].time) / 1e6
    sys.stdout.write(f"{given.output}: {len(kept)} records in {span:.1f} s\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
