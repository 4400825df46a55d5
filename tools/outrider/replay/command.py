"""Command ``outrider replay RUN_DIR``: re-runs each companion and compares what it sends."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

from mavlink_bridge.messages import Message
from mavlink_bridge.wire.codec import Codec
from outrider.replay.companion_replay import Difference, LinkFrame, Replayed
from outrider.replay.run_replay import again
from outrider.terminal.share_progress import share_progress


def replay(directory: Path, as_json: bool = False) -> int:
    """Re-run the flight in ``directory`` and report; return 0 if all bytes are the same, otherwise 1.

    Raises InputError for a directory without a run.
    """
    with share_progress() as watch:
        found = again(directory, watch)
    same = all(one.identical for one in found)
    if as_json:
        document = {"identical": same, "vehicles": [_document(one) for one in found]}
        sys.stdout.write(json.dumps(document) + "\n")
    else:
        _show(str(directory), found)
    return 0 if same else 1


def _document(one: Replayed) -> dict[str, object]:
    return {
        "system_id": one.system,
        "identical": one.identical,
        "steps": one.steps,
        "frames": one.frames,
        "setpoints": one.setpoints,
        "different": one.different,
        "stray": one.stray,
        "first_difference": None if one.first is None else words(one.first),
    }


def _show(name: str, found: tuple[Replayed, ...]) -> None:
    same = all(one.identical for one in found)
    table = Table()
    for head in ("vehicle", "steps", "frames sent again", "set-points", "different", "not at a step"):
        table.add_column(head, justify="right")
    for one in found:
        row = (one.system, one.steps, one.frames, one.setpoints, one.different, one.stray)
        table.add_row(*map(str, row))
    console = Console()
    # Printed above the table, so that a long name is not broken.
    heading = Text(f"{name} · {'the same to the last bit' if same else 'not the same'}")
    console.print(heading, soft_wrap=True)
    console.print(table)
    for one in found:
        if one.first is not None:
            console.print(Text(f"vehicle {one.system}, first difference: {words(one.first)}"), soft_wrap=True)


def words(difference: Difference) -> str:
    """Return time, message and fields in which two flights first differ, as text."""
    before, after = _read(difference.logged), _read(difference.replayed)
    where = f"at {difference.time} µs"
    if before is None or after is None or type(before) is not type(after):
        return f"{where}: the log has {_kind(before)}, now it is {_kind(after)}"
    parts = [
        f"{field} {was!r} → {now!r}"
        for field, was, now in zip(before._fields, before, after, strict=True)
        if was != now
    ]
    return f"{where}: {type(before).__name__}: {', '.join(parts) or 'the sequence number'}"


def _kind(message: Message | None) -> str:
    return "nothing" if message is None else type(message).__name__


def _read(sent: LinkFrame | None) -> Message | None:
    found = [] if sent is None else Codec().feed(sent.frame)
    return found[0] if found else None
