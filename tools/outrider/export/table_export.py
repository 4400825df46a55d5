"""Export of a run or a log as tables."""

from __future__ import annotations

from itertools import chain
from pathlib import Path

from outrider.export import mavlink_tables, motion_tables
from outrider.export.table_files import TableFiles
from outrider.export.written import Written
from outrider.logs.message_stream import Watch, watched
from outrider.runs.source import Run


def write(run: Run, folder: Path, form: str, watch: Watch) -> Written:
    """Write all data of ``run`` to ``folder``; ``form`` is ``csv`` or ``parquet``."""
    messages = watched(list(run.logs), watch)
    logs = ((log.owner or 0, spoken) for log, spoken in zip(run.logs, messages, strict=True))
    with TableFiles(folder, form) as files:
        for part in chain(motion_tables.parts(run), mavlink_tables.parts(logs)):
            files.write(part)
        return Written(files.tables, files.rows)
