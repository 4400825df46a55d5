"""ORCA (pyrvo, the RVO2 library) on the scenes of `benchmarks.scenes`, with many settings.

    .venv/bin/pip install -e '.[peers]'          # or: uv sync --extra sitl --extra peers
    .venv/bin/python tools/benchmarks/orca.py [--seeds 10] [--top 5] [--json]

ORCA (van den Berg, Guy, Lin and Manocha, Reciprocal n-Body Collision Avoidance, 2011) is made for discs that
reach any velocity at once. Here double integrators with bounded acceleration follow its velocities as well as
possible. It is planar, so the scenes are seen from above: their heights are ignored, and separation is
horizontal. The best setting of a scene is selected after the flights; outrider has one setting for all
scenes.
"""

from __future__ import annotations

import argparse
import json
import sys
from concurrent.futures import ProcessPoolExecutor
from importlib.util import find_spec
from itertools import product
from signal import SIG_IGN, SIGINT, signal
from typing import NamedTuple

import numpy as np

from benchmarks.integrators import STEP, V_MAX, Flown, fly
from benchmarks.orca_settings import SETTINGS, Setting
from benchmarks.orca_table import Row, one_for_all, row_of, show
from benchmarks.scenes import SCENES, places
from outrider.errors import InputError, OutriderError
from outrider.interruption import interruptible
from outrider.processes.cores import cores
from outrider.scenarios.starts import Array

ADVICE = "pyrvo is not installed, and this benchmark needs it: .venv/bin/pip install -e '.[peers]'"
_SIGHT = 30.0
"""Distance (m) up to which neighbours count: the whole scene."""


class Orca:
    """`Avoidance` for ``count`` discs."""

    def __init__(self, count: int, radius: float, horizon: float) -> None:
        import pyrvo  # An extra, which only flights with ORCA need.

        self._discs = range(count)
        self._simulator = pyrvo.RVOSimulator()
        self._simulator.set_time_step(STEP)
        # The second horizon is that of obstacles; there are none.
        self._simulator.set_agent_defaults(_SIGHT, count, horizon, horizon, radius, V_MAX)
        for _ in self._discs:
            self._simulator.add_agent((0.0, 0.0))

    def velocities(self, positions: Array, velocities: Array, preferred: Array) -> Array:
        """Return the velocities that ORCA chooses for all vehicles."""
        simulator = self._simulator
        states = zip(positions.tolist(), velocities.tolist(), preferred.tolist(), strict=True)
        for disc, (position, velocity, wish) in enumerate(states):
            simulator.set_agent_position(disc, position)
            simulator.set_agent_velocity(disc, velocity)
            simulator.set_agent_pref_velocity(disc, wish)
        simulator.do_step()
        chosen = [simulator.get_agent_velocity(disc) for disc in self._discs]
        return np.array([(velocity.x, velocity.y) for velocity in chosen])


class Cell(NamedTuple):
    """One task: the name of a scene and a setting, flown with seeds 1 to ``seeds``."""

    scene: str
    setting: Setting
    seeds: int


def flown(cell: Cell) -> list[Flown]:
    """Return a flight for each seed. Raises InputError if the scene has no goals."""
    found = []
    for seed in range(1, cell.seeds + 1):
        scenario = SCENES[cell.scene](seed)
        there = places(scenario, seed)
        if there.goals is None:
            raise InputError(f"scene {cell.scene} has no goals")
        orca = Orca(scenario.vehicles, cell.setting.radius_m, cell.setting.horizon_s)
        ends = there.positions[:, :2], there.goals[:, :2]
        found.append(fly(*ends, orca, cell.setting.manner, scenario.d_min, scenario.cap_s))
    return found


def measured(seeds: int, jobs: int) -> list[Row]:
    """Fly every setting on every scene; report every tenth on standard error."""
    cells = [Cell(scene, setting, seeds) for scene, setting in product(SCENES, SETTINGS)]
    rows = []
    # Ctrl-C reaches the workers too; this process ends them.
    pool = ProcessPoolExecutor(jobs, initializer=signal, initargs=(SIGINT, SIG_IGN))
    try:
        for cell, flights in zip(cells, pool.map(flown, cells), strict=True):
            rows.append(row_of(cell.scene, cell.setting, flights))
            if len(rows) % 10 == 0 or len(rows) == len(cells):
                sys.stderr.write(f"{len(rows)}/{len(cells)} settings, {cell.scene}\n")
    finally:
        pool.shutdown(cancel_futures=True)
    return rows


def main() -> int:
    """Run the command line; return 2 without pyrvo, 3 if it is interrupted."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=_positive, default=10, help="flights of each scene and setting")
    parser.add_argument("--top", type=_positive, help="show only so many settings of each scene")
    parser.add_argument("--jobs", type=_positive, default=cores(), help="processes")
    parser.add_argument("--json", action="store_true", help="one document with every scene and setting")
    given = parser.parse_args()
    try:
        if find_spec("pyrvo") is None:
            raise InputError(ADVICE)
        with interruptible("nothing is kept"):
            rows = measured(given.seeds, given.jobs)
    except OutriderError as error:
        sys.stderr.write(f"{error}\n")
        return error.exit_status
    if given.json:
        best = one_for_all(rows)[0].setting._asdict()
        document = {"rows": [row.document() for row in rows], "one_for_all": best}
        sys.stdout.write(json.dumps(document) + "\n")
    else:
        show(rows, given.top)
    return 0


def _positive(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is no whole number of at least 1")
    return int(text)


if __name__ == "__main__":
    sys.exit(main())
