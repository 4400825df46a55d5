"""The page in a browser without a network: what it shows, and what a click does. Needs Chromium."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from collections.abc import Callable
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from outrider.palette import VEHICLES
from outrider.report.command import report
from outrider.runs.surfaces import Surfaces
from tests.outrider.report.runs import WrittenRun, leave
from tests.outrider.shipped import scenario

CHROMIUM = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome", "chrome"))), None
)

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium is installed"),
]
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--no-first-run",
    "--disable-background-networking",
    "--virtual-time-budget=3000",
    "--host-resolver-rules=MAP * ~NOTFOUND",
    "--window-size=1280,1000",
    "--enable-logging=stderr",
)
Browse = Callable[..., str]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> WrittenRun:
    """A run with its page; somebody tried to slip a program into its log."""
    made = leave(tmp_path_factory.mktemp("run"), text="<script>document.title='mine'</script>")
    report(made.directory)
    return made


@pytest.fixture
def browse(tmp_path: Path) -> Browse:
    """Opens a page from disk, and gives its elements after its program ran. ``also`` is a program that runs
    after that, and ``within`` one that runs at its end and has its names: the page's policy is then taken
    off; ``silent``: nothing goes wrong."""

    def call(page: Path, address: str = "", also: str = "", within: str = "", silent: bool = True) -> str:
        assert CHROMIUM is not None
        if also or within:
            text = re.sub(r'<meta http-equiv="Content-Security-Policy"[^>]*>', "", page.read_text())
            text = text.replace("\n})();", f"\n{within}\n}})();")
            page = tmp_path / "page.html"
            page.write_text(text.replace("</body>", f"<script>{also}</script></body>"))
        done = subprocess.run(
            [
                CHROMIUM,
                *FLAGS,
                f"--user-data-dir={tmp_path / 'profile'}",
                "--dump-dom",
                f"file://{page}{address}",
            ],
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        wrong = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
        assert silent == (not wrong), wrong
        return done.stdout

    return call


def within(page: str, identifier: str) -> str:
    """The text of an element."""
    found = re.search(rf'id="{identifier}"[^>]*>([^<]*)<', page)
    assert found is not None
    return unescape(found[1])


def nearest(made: WrittenRun, time: float) -> float:
    """The run's own figure at a time."""
    with np.load(made.directory / "flight.npz") as file:
        return float(file["separation"][int(np.argmin(np.abs(file["time_s"] - time)))])


@pytest.mark.parametrize("time", [0.0, 3.2, 9.96])
def test_the_page_shows_the_flight_at_a_time(time: float, made: WrittenRun, browse: Browse) -> None:
    page = browse(made.directory / "report.html", f"#{time}")
    shown = within(page, "now")
    assert shown.startswith(f"{time:.2f} s · nearest {nearest(made, time):.2f} m, ")
    # The scene and the chart show the number in the file.
    assert f"vehicle to vehicle {nearest(made, time):.2f}</span>" in page
    assert within(page, "clock") == f"{time:.2f} s"
    assert page.count('class="line"') == 5 * 3 + 2
    assert "mine</title>" not in page
    assert re.search(r"<title>[^<]* · outrider</title>", page)


def test_the_canvas_is_painted(made: WrittenRun, browse: Browse) -> None:
    also = """
      const canvas = document.getElementById("view");
      const data = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
      const seen = new Set();
      for (let i = 0; i < data.length; i += 4) {
        if (data[i + 3] > 250) seen.add(((data[i] << 16) | (data[i + 1] << 8) | data[i + 2]).toString(16));
      }
      document.body.dataset.seen = [...seen].join(" ");
    """
    page = browse(made.directory / "report.html", "#3", also)
    found = re.search(r'data-seen="([^"]*)"', page)
    assert found is not None
    # The colours of the three vehicles, among others.
    assert {code[1:] for code in VEHICLES[:3]} <= set(found[1].split())


OBSTACLES: list[dict[str, Any]] = [
    {"kind": "wall", "ends": [[-7.0, -2.0], [1.0, -6.0]], "thickness": 0.3, "height": 4.0},
    {"kind": "wall", "ends": [[2.0, 7.0], [7.0, 1.0]], "height": 5.0},
    {"kind": "box", "at": [0.0, 0.0, 1.0], "size": [4.0, 2.0, 2.0], "yaw_deg": 30.0},
    {"kind": "box", "at": [0.3, 0.0, 4.0], "size": [1.5, 2.5, 1.0], "yaw_deg": 70.0},
    {"kind": "box", "at": [-5.0, 4.0, 2.0], "size": [2.0, 2.0, 4.0], "yaw_deg": 45.0},
    {"kind": "box", "at": [5.0, -4.0, 3.0], "size": [3.0, 1.0, 1.0]},
]


def test_boxes_hide_what_is_behind_them_and_nothing_else(browse: Browse, tmp_path: Path) -> None:
    """A point is painted among the boxes, seen from everywhere: its pixel shows whether it was hidden."""
    of = scenario("antipodal-8", vehicles=3, obstacles=OBSTACLES)
    directory = leave(tmp_path / "run", scenario=of).directory
    report(directory)
    within = """
      let seed = 7;
      const random = () => (seed = (seed * 16807) % 2147483647) / 2147483647;
      const sheet = document.createElement("canvas");
      [sheet.width, sheet.height] = [camera.width, camera.height];
      const g = sheet.getContext("2d", { willReadFrequently: true });
      const told = [];
      for (let round = 0; round < 12; round++) {
        camera.flat = round % 4 === 3;
        [camera.azimuth, camera.elevation] = [6.3 * random(), 1.6 * random()];
        camera.distance = 8 + 20 * random();
        aim();
        for (let k = 0; k < 30; k++) {
          const point = [16 * random() - 8, 16 * random() - 8, 6 * random()];
          const [x, y] = project(point) ?? [-1, -1];
          if (x < 5 || y < 5 || x > camera.width - 5 || y > camera.height - 5) continue;
          g.clearRect(0, 0, camera.width, camera.height);
          const draw = () => {
            g.fillStyle = "#ff0000";
            g.fillRect(x - 3, y - 3, 6, 6);
          };
          inOrder(g, [{ point, depth: depth(point), draw }]);
          const [red, green] = g.getImageData(Math.round(x), Math.round(y), 1, 1).data;
          told.push([...viewpoint(), ...point, red > 200 && green < 50 ? 1 : 0]);
        }
      }
      document.body.dataset.told = JSON.stringify(told);
    """
    page = browse(directory / "report.html", "#1", within=within)
    found = re.search(r'data-told="([^"]*)"', page)
    assert found is not None
    surfaces = Surfaces(of.obstacles)
    shown = {True: 0, False: 0}
    for *places, seen in json.loads(found[1]):
        eye, point = np.reshape(places, (2, 3))
        away = float(np.linalg.norm(eye - point))
        line = point + np.linspace(0.0, min(1.0, 50.0 / away), 3001)[:, None] * (eye - point)
        nearest = float(surfaces.nearest(line[:, None]).min())
        # A pixel is a few centimetres wide.
        if abs(nearest) > 0.06:
            assert bool(seen) == (nearest > 0.0), (eye, point, nearest)
            shown[bool(seen)] += 1
    assert min(shown.values()) > 30


def test_clicks_and_keys(made: WrittenRun, browse: Browse) -> None:
    also = """
      const told = [];
      const now = () => document.getElementById("clock").textContent;
      document.querySelectorAll("button[data-time]").forEach((button) => {
        if (button.textContent === "7.50") button.click();
      });
      told.push(now());
      const slider = document.getElementById("slider");
      slider.value = 2;
      slider.dispatchEvent(new Event("input"));
      told.push(now());
      const view = document.getElementById("view");
      const key = (name) => view.dispatchEvent(new KeyboardEvent("keydown", { key: name }));
      key(".");
      told.push(now());
      ["t", "0", "f", "+", "-", "ArrowLeft", "ArrowUp"].forEach(key);
      document.querySelector("#vehicles button").click();
      told.push(document.querySelectorAll("#charts .line").length);
      const chart = document.querySelector("#charts svg[role=img]");
      const box = chart.getBoundingClientRect();
      const at = { clientX: box.right - 12, clientY: box.top + 30, buttons: 1, pointerId: 1 };
      chart.dispatchEvent(new PointerEvent("pointermove", at));
      told.push(now());
      document.getElementById("range").value = "all";
      document.getElementById("range").dispatchEvent(new Event("change"));
      told.push(slider.min);
      document.body.dataset.told = told.join(" | ");
    """
    page = browse(made.directory / "report.html", "#1", also)
    found = re.search(r'data-told="([^"]*)"', page)
    assert found is not None
    assert found[1] == "7.50 s | 2.00 s | 2.04 s | 12 | 10.00 s | -3"


def test_it_plays(made: WrittenRun, browse: Browse) -> None:
    # A browser without a screen shows as few pictures as it likes.
    also = """
      window.requestAnimationFrame = (show) => setTimeout(() => show(performance.now()), 20);
      document.getElementById("speed").value = "4";
      document.getElementById("speed").dispatchEvent(new Event("change"));
      document.getElementById("play").click();
    """
    page = browse(made.directory / "report.html", "#5", also)
    assert float(within(page, "clock").removesuffix(" s")) > 7.0


def test_the_policy_stops_what_would_get_in(made: WrittenRun, browse: Browse, tmp_path: Path) -> None:
    """As if a text had not been escaped."""
    text = (made.directory / "report.html").read_text()
    page = tmp_path / "open.html"
    page.write_text(text.replace("</main>", "<script>document.title = 'mine'</script></main>"))
    seen = browse(page, "#2", silent=False)
    assert "<title>mine" not in seen
    assert within(seen, "clock") == "2.00 s"


def test_a_page_without_a_flight_stands(tmp_path: Path, browse: Browse) -> None:
    directory = leave(tmp_path / "run").directory
    (directory / "flight.npz").unlink()
    report(directory)
    page = browse(directory / "report.html")
    assert "Missing or damaged" in page
    assert page.count('hidden=""') >= 2
