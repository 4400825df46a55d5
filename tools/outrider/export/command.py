"""Command ``outrider export``: writes a run directory or a log in the file format of another tool."""

from __future__ import annotations

import json
import sys
from difflib import get_close_matches
from pathlib import Path
from typing import NamedTuple

from rich.console import Console
from rich.table import Table
from rich.text import Text

from mavlink_bridge.errors import LogError
from outrider.errors import InputError
from outrider.export.place import FORMATS, destination, fresh
from outrider.export.written import Written
from outrider.logs.message_stream import Watch, total_loss
from outrider.runs.source import Run, read
from outrider.terminal.share_progress import share_progress


class Result(NamedTuple):
    """Result of an export: the files written, and the data left out.

    ``out_of_order``: messages that would go back in time; ``damaged_records``: records that cannot be read;
    ``unknown_messages``: messages that the dialect does not define; ``unread_logs``: a line for each file
    that is no readable log.
    """

    format: str
    out: str
    files: int
    bytes: int
    topics: int
    messages: int
    out_of_order: int
    damaged_records: int
    unknown_messages: int
    unread_logs: tuple[str, ...]


def export(source: Path, form: str, out: Path | None, as_json: bool) -> None:
    """Export ``source`` in the format ``form`` and print the result.

    Raises InputError, with one line, if the source cannot be exported.
    """
    _check(form)
    place = destination(source, form, out) if source.exists() else source
    run = read(source)
    with share_progress() as watch, fresh(place, form) as part:
        try:
            written = _write(run, part, form, watch)
        except LogError as error:
            raise InputError(str(error)) from None
        files = (
            [path for path in part.rglob("*") if path.is_file()]
            if part.is_dir()
            else [*part.parent.iterdir()]
        )
        size = sum(path.stat().st_size for path in files)
    loss = total_loss(list(run.logs))
    result = Result(form, str(place), len(files), size, *written, loss.damaged, loss.unknown, run.unread)
    if as_json:
        sys.stdout.write(json.dumps(result._asdict()) + "\n")
    else:
        show(result)


def _check(form: str) -> None:
    if form not in FORMATS:
        near = get_close_matches(form, FORMATS, n=1)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        raise InputError(f"--format {form}: no such format; allowed: {', '.join(FORMATS)}{hint}")


def _write(run: Run, place: Path, form: str, watch: Watch) -> Written:
    """Write the export with the module of the format, imported only when it is needed."""
    if form == "mcap":
        from outrider.export import mcap_export

        return mcap_export.write(run, place, watch)
    if form == "ulog":
        from outrider.export import ulog_export

        return ulog_export.write(run, place, watch)
    from outrider.export import table_export

    return table_export.write(run, place, form, watch)


def show(result: Result) -> None:
    """Print the result as a table."""
    table = Table(show_header=False)
    rows = {
        "files": result.files,
        "size, MB": f"{result.bytes / 1e6:.2f}",
        "channels or tables": result.topics,
        "messages or rows": result.messages,
        "messages left out, back in time": result.out_of_order,
        "damaged records left out": result.damaged_records,
        "messages that the dialect lacks": result.unknown_messages,
    }
    for words, value in rows.items():
        table.add_row(words, str(value))
    console = Console()
    # Printed above the table, because a table would break a long path.
    console.print(Text(result.out), soft_wrap=True)
    console.print(table)
    for line in result.unread_logs:
        console.print(Text(f"left out: {line}"), soft_wrap=True)
