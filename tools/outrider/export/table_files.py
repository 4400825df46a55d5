"""Tables as CSV or Parquet files in a folder, written in parts so that no table has to fit into memory."""

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
    """Some rows of a ``table`` (a path below the folder, without suffix), column by column."""

    table: str
    columns: dict[str, Column]


class TableFiles:
    """Writer of tables to ``folder``; a context manager. The same parts give the same bytes."""

    def __init__(self, folder: Path, form: str) -> None:
        self.rows = 0
        self._folder, self._form = folder, form
        self._open: dict[str, pyarrow.csv.CSVWriter | pyarrow.parquet.ParquetWriter] = {}
        # A large fleet has more tables than the default limit of open files.
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
        """Number of tables so far."""
        return len(self._open)

    def write(self, part: Part) -> None:
        """Append a part to its table; in Parquet the part becomes a row group."""
        batch = pa.table({name: _array(column) for name, column in part.columns.items()})
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


def _array(column: Column) -> pa.Array:
    """Return a column for a table: datetime64 as a time stamp in UTC, NaN as null."""
    if isinstance(column, np.ndarray) and column.dtype.kind == "M":
        return pa.array(column, type=pa.timestamp("us", tz="UTC"))
    return pa.array(column, from_pandas=True)
