"""CSV and Parquet: read back by pyarrow, and against pymavlink and what was flown."""

from __future__ import annotations

import re
import shutil
from collections import Counter
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
import pytest
from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.tlog.log import read_tlog
from outrider.export import mavlink_tables
from outrider.export.command import export
from outrider.export.mavlink_tables import HEAD, columns
from outrider.logs.dialect import identifiers, kind
from tests.outrider.export.runs import SYSTEMS, Heard, all_same, everything, received

AXES = ("east", "north", "up")


def tables(folder: Path) -> dict[str, pa.Table]:
    """Every table by its path; CSV with the types that the same table has in Parquet."""
    found = {}
    for path in folder.rglob("*.parquet"):
        found[str(path.relative_to(folder).with_suffix(""))] = pyarrow.parquet.read_table(path)
    return found


def csv_table(path: Path, types: pa.Schema) -> pa.Table:
    return pyarrow.csv.read_csv(
        path,
        parse_options=pyarrow.csv.ParseOptions(newlines_in_values=True),
        convert_options=pyarrow.csv.ConvertOptions(column_types=types, null_values=[""]),
    )


@pytest.fixture(scope="module")
def exported(run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("out")
    for form in ("csv", "parquet"):
        export(run, form, folder / form, as_json=True)
    return folder


@pytest.fixture(scope="module")
def found(exported: Path) -> dict[str, pa.Table]:
    return tables(exported / "parquet")


def test_csv_and_parquet_hold_the_same(exported: Path, found: dict[str, pa.Table]) -> None:
    files = {path.relative_to(exported / "csv").with_suffix("") for path in (exported / "csv").rglob("*.csv")}
    assert {str(path) for path in files} == found.keys()
    for name, table in found.items():
        other = csv_table(exported / "csv" / f"{name}.csv", table.schema)
        assert other.column_names == table.column_names
        for column in table.column_names:
            assert all_same(other[column].to_pylist(), table[column].to_pylist()), (name, column)


def test_vehicles_are_those_that_were_flown(run: Path, found: dict[str, pa.Table]) -> None:
    with np.load(run / "flight.npz") as file:
        flight = dict(file)
    table = found["vehicles"]
    system = table["system"].to_numpy()
    for k, one in enumerate(SYSTEMS):
        rows = system == one
        np.testing.assert_array_equal(table["time_s"].to_numpy()[rows], flight["time_s"])
        unix = flight["start_us"] + np.rint(flight["time_s"] * 1e6).astype(np.int64)
        assert table.schema.field("utc").type == pa.timestamp("us", tz="UTC")
        np.testing.assert_array_equal(table["utc"].to_numpy()[rows], unix.astype("datetime64[us]"))
        for array, prefix, unit in (
            ("position", "", "m"),
            ("velocity", "velocity_", "m_s"),
            ("reference", "reference_", "m"),
        ):
            told = [table[f"{prefix}{axis}_{unit}"].to_numpy()[rows] for axis in AXES]
            np.testing.assert_array_equal(np.stack(told, axis=1), flight[array][:, k])
        np.testing.assert_array_equal(table["yaw_rad"].to_numpy()[rows], flight["yaw"][:, k])
        np.testing.assert_array_equal(table["tilt_rad"].to_numpy()[rows], flight["tilt"][:, k])
    np.testing.assert_array_equal(found["separation"]["separation_m"].to_numpy(), flight["separation"])
    for k, one in enumerate((190, 191)):
        rows = found["moving"]["system"].to_numpy() == one
        told = np.stack([found["moving"][f"{axis}_m"].to_numpy()[rows] for axis in AXES], axis=1)
        np.testing.assert_array_equal(told, flight["moving"][:, k])


def test_plans_are_those_that_were_made(run: Path, found: dict[str, pa.Table]) -> None:
    with np.load(run / "plans.npz") as plans:
        told = [found["plans"][f"gradient_{axis}_m"].to_numpy() for axis in AXES]
        np.testing.assert_array_equal(np.stack(told, axis=1), plans["gradient"])
        np.testing.assert_array_equal(found["plans"]["time_s"].to_numpy(), plans["time_s"])
    with np.load(run / "plan_times.npz") as times:
        np.testing.assert_array_equal(found["plan_times"]["plan_ms"].to_numpy(), times["plan_ms"])
        # A plan takes time after it is due, and each vehicle's are due one after the other.
        for system in SYSTEMS:
            assert (np.diff(times["time_s"][times["system"] == system]) > 0.0).all()


def stamp(time: int) -> datetime:
    """A time in Unix µs as the tables have it."""
    return datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=time)


def rows_of(found: dict[str, pa.Table]) -> list[tuple[Any, ...]]:
    """Of all tables of messages: log, time, link, who, name, and a text of the rest."""
    rows = []
    for name, table in found.items():
        if name.startswith("mavlink/"):
            for row in table.to_pylist():
                time, *head = (row.pop(one) for one in HEAD)
                rows.append((time, *head, name.rpartition("/")[2], repr(row)))
    return rows


def expected_row(message: Heard) -> dict[str, Any]:
    """A message as a row, by pymavlink's own account of it."""
    definition = getattr(mavlink, f"MAVLink_{message.name.lower()}_message")
    row: dict[str, Any] = {}
    for name, of in zip(definition.fieldnames, definition.fieldtypes, strict=True):
        unit = definition.fieldunits_by_name.get(name)
        suffix, value = f" [{unit}]" if unit else "", message.fields[name]
        if isinstance(value, list) and of == "uint8_t" and not unit:
            row[name] = bytes(value).hex()
        elif isinstance(value, list):
            row |= {f"{name}[{k}]{suffix}": item for k, item in enumerate(value)}
        else:
            row[f"{name}{suffix}"] = value
    # NaN is a missing value.
    return {name: None if value != value else value for name, value in row.items()}


def test_every_message_of_the_logs_is_there(run: Path, found: dict[str, pa.Table]) -> None:
    expected = [
        (stamp(one.time), system, one.link, one.system, one.component, one.name, repr(expected_row(one)))
        for system in SYSTEMS
        for one in received(run / f"vehicle-{system}.tlog")
    ]
    assert Counter(rows_of(found)) == Counter(expected)
    assert "lat [degE7]" in found["mavlink/11/GLOBAL_POSITION_INT"].column_names


def test_any_message_of_the_dialect_becomes_a_row(tmp_path: Path) -> None:
    log = tmp_path / "all.tlog"
    everything(log)
    for form in ("parquet", "csv"):
        export(log, form, tmp_path / form, as_json=True)
    found = tables(tmp_path / "parquet")
    waiting = {name: iter(table.to_pylist()) for name, table in found.items()}
    for message in received(log):
        row = next(waiting[f"mavlink/1/{message.name}"])
        assert row.pop("utc") == stamp(message.time)
        assert [row.pop(name) for name in HEAD[1:]] == [0, message.link, 1, 1]
        assert all_same(row.values(), expected_row(message).values()), message.name
        assert list(row) == list(expected_row(message))
    for name, table in found.items():
        other = csv_table(tmp_path / "csv" / f"{name}.csv", table.schema)
        for column in table.column_names:
            assert all_same(other[column].to_pylist(), table[column].to_pylist()), (name, column)


def test_a_key_that_a_log_of_others_holds_is_not_passed_on(tmp_path: Path) -> None:
    peer, key = mavlink.MAVLink(None, 255, 190), bytes(range(1, 33))
    beat = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
    setup = mavlink.MAVLink_setup_signing_message(11, 1, list(key), 36_000_000_000_000)
    log = tmp_path / "others.tlog"
    stamp = (1_700_000_000_000_000).to_bytes(8, "big")
    log.write_bytes(b"".join(stamp + message.pack(peer) for message in (beat, setup, beat)))
    export(log, "parquet", tmp_path / "out", as_json=True)
    found = tables(tmp_path / "out")
    assert [name for name in found if "mavlink" in name] == ["mavlink/255/HEARTBEAT"]
    assert len(found["mavlink/255/HEARTBEAT"]) == 2


def test_no_two_columns_of_a_table_have_one_name() -> None:
    for number in identifiers():
        of = kind(number)
        empty = np.zeros(1, dtype=of.dtype)
        names = [name for field in of.fields for name in columns(field, empty[field.name])]
        assert len({*names, *HEAD}) == len(names) + len(HEAD), of.name
        assert all(re.fullmatch(r"\w+(\[\d+\])?( \[[^\]]+\])?", name) for name in names)


def test_what_does_not_fit_into_memory_at_once_gives_the_same_rows(
    run: Path,
    found: dict[str, pa.Table],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(mavlink_tables, "_PART_ROWS", 7)
    monkeypatch.setattr(mavlink_tables, "_MAX_BUFFER_BYTES", 1000)
    export(run, "parquet", tmp_path / "parts", as_json=True)
    assert Counter(rows_of(tables(tmp_path / "parts"))) == Counter(rows_of(found))
    path = tmp_path / "parts" / "mavlink" / "11" / "LOCAL_POSITION_NED.parquet"
    assert pyarrow.parquet.ParquetFile(path).num_row_groups > 10


def test_the_same_run_gives_the_same_bytes(run: Path, exported: Path, tmp_path: Path) -> None:
    for form in ("csv", "parquet"):
        export(run, form, tmp_path / form, as_json=True)
        for path in (tmp_path / form).rglob("*.*"):
            assert path.read_bytes() == (exported / form / path.relative_to(tmp_path / form)).read_bytes()


@pytest.mark.parametrize("seed", range(4))
def test_damage_costs_what_is_damaged_and_nothing_else(run: Path, tmp_path: Path, seed: int) -> None:
    whole, broken = tmp_path / "whole.tlog", tmp_path / "broken.tlog"
    shutil.copy(run / "vehicle-11.tlog", whole)
    chance = np.random.default_rng(seed)
    data = bytearray(whole.read_bytes())
    hit = set()
    starts = np.cumsum([0, *(8 + len(record.frame) for record in read_tlog(whole))])
    for at in chance.integers(100, len(data), 20).tolist():
        # Behind the stamp: a stamp that is wrong but likely is nothing that anybody could see.
        record = int(np.searchsorted(starts, at, side="right")) - 1
        data[max(at, int(starts[record]) + 8)] ^= 0x55
        hit.add(record)
    broken.write_bytes(bytes(data))
    for log in (whole, broken):
        export(log, "parquet", log.with_suffix(""), as_json=True)
    before, after = (Counter(rows_of(tables(tmp_path / name))) for name in ("whole", "broken"))
    assert not after - before
    assert (before - after).total() == len(hit)
