"""Cost of a live view for a real-time flight: missed deadlines with and without it, in turns.

``python -m benchmarks.view_deadlines [ROUNDS] [--priority] [--browser]``: on an otherwise idle machine, or
with ``--priority`` (real-time priority for all flying processes) on a busy one. With ``--browser`` a page is
open too (Playwright and Chromium, rendering in software): it takes a core, as a browser does.
"""

from __future__ import annotations

import sys
import tempfile
from contextlib import ExitStack
from pathlib import Path
from shutil import which
from typing import NamedTuple

from outrider.scenarios.options import Options
from outrider.simulation.preparation import prepare
from outrider.swarm import command as swarm
from outrider.swarm.command import Pace
from outrider.swarm.show import FlightView
from outrider.view.viewer_client import ViewerClient

VEHICLES = 4
FLIGHTS = ("without", "with")


class FlightPunctuality(NamedTuple):
    """Punctuality of one flight.

    It has the share of the companions' deadlines that were missed, and the 99th percentile of the lateness
    (ms).
    """

    missed: float
    late_ms: float


def flight(stack: ExitStack, options: set[str], view: bool, seed: int) -> FlightPunctuality:
    """Fly one flight, with a view or without."""
    prepared = prepare("antipodal", Options(vehicles=VEHICLES))
    directory = Path(stack.enter_context(tempfile.TemporaryDirectory()))
    show = None
    if view:
        viewer = ViewerClient(port=18300)
        stack.callback(viewer.close)
        show = FlightView(viewer, watched=False)
        if "--browser" in options:
            _open(stack, viewer.url)
    pace = Pace(real_time=True, priority="--priority" in options)
    summary = swarm.fly(prepared, seed, directory, lambda _stage, _seconds: None, pace, show)
    misses, steps, late = summary["deadline_misses"], summary["deadline_steps"], summary["lateness_ms"]
    if not (isinstance(misses, int) and isinstance(steps, int) and isinstance(late, dict)):
        raise TypeError(f"no deadlines in the summary: {summary}")
    return FlightPunctuality(misses / max(steps, 1), float(late["p99"] or 0.0))


def _open(stack: ExitStack, url: str) -> None:
    from playwright.sync_api import sync_playwright

    flags = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
    driver = stack.enter_context(sync_playwright())
    chromium = driver.chromium.launch(executable_path=which("chromium"), args=flags)
    stack.callback(chromium.close)
    page = chromium.new_page(viewport={"width": 800, "height": 600})
    page.goto(url)
    page.wait_for_selector("canvas", timeout=120_000)


def main() -> None:
    """Fly in turns and print the results."""
    rounds = next((int(word) for word in sys.argv[1:] if word.isdigit()), 3)
    options = set(sys.argv[1:])
    found: dict[bool, list[FlightPunctuality]] = {False: [], True: []}
    for seed in range(1, rounds + 1):
        for view in (False, True) if seed % 2 else (True, False):
            with ExitStack() as stack:
                found[view].append(flight(stack, options, view, seed))
            last = found[view][-1]
            sys.stdout.write(
                f"seed {seed} {FLIGHTS[view]:8} {100.0 * last.missed:6.2f} % missed, "
                f"p99 {last.late_ms:.2f} ms late\n"
            )
            sys.stdout.flush()
    means = [100.0 * sum(one.missed for one in found[view]) / rounds for view in (False, True)]
    sys.stdout.write(
        f"missed without {means[0]:.2f} %, with {means[1]:.2f} %: {means[1] - means[0]:+.2f} points\n"
    )


if __name__ == "__main__":
    main()
