"""Tables as files of a folder, CSV or Parquet: written by parts, so that none has to fit into memory."""

from __future__ import annotations

import resource
from pathlib import Path
from types import TracebackType
from typing import Final, NamedTuple, Self

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
from numpy.typing import NDArray

FORMATS: Final = ("csv", "parquet")
_COMPRESSION: Final = "zstd"

Column = NDArray[np.generic] | list[str]


class Part(NamedTuple):
    """Some rows of the ``table`` (a path without ending below the folder), column by column."""

    table: str
    columns: dict[str, Column]


class TableFiles:
    """Writes tables into ``folder``; a context manager. Same parts, same bytes."""

    def __init__(self, folder: Path, form: str) -> None:
        self.rows = 0
        self._folder, self._form = folder, form
        self._open: dict[str, pyarrow.csv.CSVWriter | pyarrow.parquet.ParquetWriter] = {}
        # A large fleet has more tables than a process may have files open at first.
        soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        if soft != hard:
            resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for writer in self._open.values():
            writer.close()

    @property
    def tables(self) -> int:
        """How many there are so far."""
        return len(self._open)

    def write(self, part: Part) -> None:
        """Append it; in Parquet it becomes a row group."""
        batch = pa.table({name: pa.array(column) for name, column in part.columns.items()})
        writer = self._open.get(part.table)
        if writer is None:
            path = self._folder / f"{part.table}.{self._form}"
            path.parent.mkdir(parents=True, exist_ok=True)
            if self._form == "csv":
                writer = pyarrow.csv.CSVWriter(str(path), batch.schema)
            else:
                writer = pyarrow.parquet.ParquetWriter(path, batch.schema, compression=_COMPRESSION)
            self._open[part.table] = writer
        writer.write_table(batch)
        self.rows += batch.num_rows
