"""One number for one moment: scene, chart, view, exports and Python interface show the file's separation."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from outrider import Flight
from outrider.export import motion_tables, series
from outrider.report.command import make
from outrider.report.replay import Packed, unpack
from outrider.runs.source import read
from outrider.view.player import load
from tests.outrider.report.runs import NEARER, WrittenRun, leave
from tests.outrider.report.test_data import embedded

TIMES = [0.0, 1.02, 3.2, 7.54, 9.98]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> WrittenRun:
    return leave(tmp_path_factory.mktemp("run"))


def in_file(directory: Path, time: float) -> float:
    with np.load(directory / "flight.npz") as file:
        return float(file["separation"][int(np.argmin(np.abs(file["time_s"] - time)))])


@pytest.mark.parametrize("time", TIMES)
def test_every_picture_has_the_number_in_the_file(made: WrittenRun, time: float) -> None:
    expected = in_file(made.directory, time)
    row = int(np.argmin(np.abs(made.time - time)))
    pairs = [
        np.linalg.norm(made.position[row, j] - made.position[row, k]) for j, k in ((0, 1), (0, 2), (1, 2))
    ]
    # The vehicles were nearer in between: whoever measures at the samples only has another number.
    assert min(pairs) - expected == pytest.approx(NEARER, abs=1e-3)
    said = f"{expected:.2f}"

    charts = {one["key"]: one for one in embedded(make(made.directory).text)["charts"]}  # type: ignore[attr-defined]
    chart = charts["separation"]
    at = int(np.argmin(np.abs(unpack(Packed(**chart["time"])) - time)))
    assert f"{unpack(Packed(**chart['values']))[at, 0]:.2f}" == said

    assert f"{load(made.directory).moment(time).least_distance():.2f}" == said
    flight = Flight(made.directory)
    assert f"{flight.separation[int(np.argmin(np.abs(flight.times - time)))]:.2f}" == said

    run = read(made.directory, "tlog:{}")
    assert run.motion is not None
    now = run.motion.start_us + round(1e6 * time)
    (channel,) = (one for one in series.entries(run) if one.topic == "/separation" and one.time == now)
    assert f'"separation":{expected:.7g}'[:18] in channel.data.decode()
    (table,) = (part.columns for part in motion_tables.parts(run) if part.table == "separation")
    there = int(np.argmin(np.abs(np.asarray(table["time_s"]) - time)))
    assert f"{np.asarray(table['separation_m'])[there]:.2f}" == said
