"""Extraction of some messages from a tlog, every record byte for byte as it was.

    .venv/bin/python tools/extract_log.py INPUT OUTPUT --message GLOBAL_POSITION_INT --start 475 --duration 70
    .venv/bin/python tools/extract_log.py INPUT OUTPUT --message HEARTBEAT --message ATTITUDE/10 --system 1 2

``NAME/10`` keeps the first and every tenth after it. ``--start`` and ``--duration`` are s of receive time
from the log's first record on; without them it is the whole log. A README next to the result describes what
was extracted. An OUTPUT that ends in .gz is compressed.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections import Counter
from pathlib import Path

from pymavlink.dialects.v20 import ardupilotmega

from mavlink_bridge.errors import LogError
from mavlink_bridge.tlog.log import Record, TlogWriter, read_tlog
from mavlink_bridge.wire.framing import Frame, frame_at


def wish(text: str) -> tuple[int, int]:
    """Parse ``NAME[/N]``: return the message number, and N, of which one is kept.

    Raises argparse.ArgumentTypeError.
    """
    name, _, every = text.partition("/")
    if every and not (every.isdecimal() and int(every) > 0):
        raise argparse.ArgumentTypeError(f"{text!r}: behind the / there must be a whole number from 1 on")
    for number, message in ardupilotmega.mavlink_map.items():
        if message.msgname == name:
            return int(number), int(every or 1)
    raise argparse.ArgumentTypeError(f"{name!r} is no message of the ardupilotmega dialect")


def stretch(
    source: Path, wishes: dict[int, int], systems: list[int], start_s: float, duration_s: float
) -> list[Record]:
    """Return the records in [start, start + duration) that match ``wishes`` and ``systems``, in log order.

    ``wishes`` maps a message number to N: one of N messages is kept.
    """
    kept = []
    seen: Counter[int] = Counter()
    first: int | None = None
    for record in read_tlog(source):
        if first is None:
            first = record.time
        if not start_s <= (record.time - first) / 1e6 < start_s + duration_s:
            continue
        frame = frame_at(record.frame, 0)
        if isinstance(frame, Frame) and frame.message_id in wishes and frame.system in systems:
            if seen[frame.message_id] % wishes[frame.message_id] == 0:
                kept.append(record)
            seen[frame.message_id] += 1
    return kept


def main() -> int:
    """Run the command line; return 2 if the log cannot be read or no record is kept."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("input", type=Path)
    parser.add_argument("output", type=Path)
    parser.add_argument("--message", type=wish, action="append", required=True, metavar="NAME[/N]")
    parser.add_argument("--system", type=int, nargs="+", default=[1], help="system ids (default 1)")
    parser.add_argument("--start", type=float, default=0.0, help="s after the first record (default 0)")
    parser.add_argument("--duration", type=float, default=math.inf, help="s (default: to the end)")
    given = parser.parse_args()
    try:
        kept = stretch(given.input, dict(given.message), given.system, given.start, given.duration)
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
