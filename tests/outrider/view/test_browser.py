"""The live view in a browser without a network: what pixels show of a flight, what a click does, and that the
flight is none the worse if all of it is killed in the middle. Needs Chromium; it renders in software."""

from __future__ import annotations

import re
import shutil
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from playwright.sync_api import Page, sync_playwright

from outrider.palette import VEHICLES, rgb
from outrider.scenarios.scenario import Scenario
from outrider.scene.datagram_channel import DatagramChannel
from outrider.simulation.flight import Flight
from outrider.simulation.preparation import Prepared
from outrider.swarm import command as swarm
from outrider.swarm.command import LOCK_STEP
from outrider.swarm.lockstep_view import LockStepView
from outrider.swarm.show import FlightView
from outrider.view.viewer_client import ViewerClient
from tests.outrider.shipped import FIREFLY, scenario
from tests.outrider.view.flights import logs

CHROMIUM = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome", "chrome"))), None
)
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium is installed"),
]
FLAGS = [
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-background-networking",
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE localhost, EXCLUDE 127.0.0.1",
]
SIZE = {"width": 1000, "height": 640}
WHERE = 2_500_000
"""µs after the goal event, when there is most to see."""
PATIENCE = 200.0
"""s; software renders as fast as the machine has time for it."""
Pixels = NDArray[np.int64]


class Waits(LockStepView):
    """Waits in mid-flight until it is released: a browser takes its time to start."""

    def __init__(self, line: DatagramChannel, released: threading.Event) -> None:
        super().__init__(line)
        self._released = released

    def __call__(self, flight: Flight, now: int) -> None:
        start = flight.conductor.clock_start
        while start is not None and now - start >= WHERE and not self._released.wait(0.1):
            self._next = 0.0
            self._listen(flight, now)
        super().__call__(flight, now)


class Waiting(FlightView):
    """Shows a flight that waits."""

    def __init__(self, viewer: ViewerClient) -> None:
        super().__init__(viewer, watched=True)
        self._line = viewer.line
        self.released = threading.Event()

    def lock_step(self, prepared: Prepared, seed: int) -> LockStepView:
        super().lock_step(prepared, seed)
        return Waits(self._line, self.released)


class Flying:
    """A lock-step flight of ``of`` in a thread of its own, with a view."""

    def __init__(self, of: Scenario, directory: Path, port: int) -> None:
        directory.mkdir()
        self.directory = directory
        self.viewer = ViewerClient(port=port)
        self.show = Waiting(self.viewer)
        self._of = Prepared(of, FIREFLY)
        self._thread = threading.Thread(target=self._fly)
        self._thread.start()

    def _fly(self) -> None:
        swarm.fly(self._of, 1, self.directory, lambda _stage, _seconds: None, LOCK_STEP, self.show)

    def kill(self) -> None:
        """The view; the flight then goes on as fast as it can."""
        self.viewer.process.kill()
        self.viewer.process.wait()

    def join(self) -> None:
        self._thread.join(2.0 * PATIENCE)
        assert not self._thread.is_alive()

    def close(self) -> None:
        self.show.released.set()
        self.kill()
        self.join()
        self.viewer.close()


class Look:
    """At the page of a view. ``asked``: all that the browser asked for, and ``wrong``: what it complained
    of."""

    def __init__(self, page: Page, url: str) -> None:
        self.page, self.asked, self.wrong = page, set[str](), list[str]()
        page.set_default_timeout(1000.0 * PATIENCE)
        page.on("request", lambda request: self.asked.add(request.url))
        page.on("websocket", lambda socket: self.asked.add(socket.url))
        page.on("pageerror", lambda error: self.wrong.append(str(error)))
        page.goto(f"{url}/?fixedDpr=1")
        page.wait_for_selector("canvas")

    def wait(self, pattern: str, least: float = -1e9) -> float:
        """Until the headline is as ``pattern`` and shows ``least`` s; what it shows."""
        self.page.wait_for_function(
            """([pattern, least]) => {
                 const found = document.body.innerText.match(new RegExp("(-?[0-9.]+) s · " + pattern));
                 return found !== null && Number(found[1]) >= least;
               }""",
            arg=[pattern, least],
        )
        found = re.search(rf"(-?[0-9.]+) s · {pattern}", self.page.inner_text("body"))
        return least if found is None else float(found[1])

    def press(self, name: str) -> None:
        self.page.get_by_role("button", name=name, exact=True).click()

    def tick(self, label: str) -> None:
        self.page.get_by_label(label, exact=True).click()

    def until(self, right: Callable[[Pixels], bool], path: Path | None = None) -> bool:
        """Whether the picture becomes ``right`` within the patience."""
        begin = time.monotonic()
        while not right(self.pixels(path)):
            if time.monotonic() - begin > PATIENCE:
                return False
            self.page.wait_for_timeout(300)
        return True

    def hush(self) -> None:
        """Take away what says that this browser renders in software."""
        close = "[...document.querySelectorAll('[class*=Notification] button')].forEach((one) => one.click())"
        self.page.evaluate(close)

    def settle(self) -> None:
        """Until what has been sent is on the screen: a few frames."""
        self.page.evaluate(
            """() => new Promise((done) => {
                 let left = 4;
                 const next = () => (left-- ? requestAnimationFrame(next) : done());
                 next();
               })"""
        )
        self.page.wait_for_timeout(700)

    def pixels(self, path: Path | None = None) -> Pixels:
        """Of the scene, (height, width, 3)."""
        data = self.page.screenshot()
        if path is not None:
            path.write_bytes(data)
        image = np.asarray(Image.open(BytesIO(data)).convert("RGB"), dtype=np.int64)
        box = self.page.locator("canvas").first.bounding_box()
        assert box is not None
        left, top, width, height = (round(box[side]) for side in ("x", "y", "width", "height"))
        return image[top : top + height, left : left + width]


@pytest.fixture(scope="module")
def page() -> Iterator[Callable[[str], Look]]:
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield lambda url: Look(browser.new_page(viewport=SIZE), url)  # type: ignore[arg-type]
        browser.close()


@pytest.fixture
def fly(tmp_path: Path) -> Iterator[Callable[[Scenario], Flying]]:
    flights: list[Flying] = []

    def begin(of: Scenario) -> Flying:
        flights.append(Flying(of, tmp_path / "watched", 18100))
        return flights[-1]

    yield begin
    for flight in flights:
        flight.close()


def near(pixels: Pixels, colour: tuple[int, int, int]) -> NDArray[np.bool_]:
    """Where it is that colour, in whatever light: by its hue, as far as it has one."""
    own = np.array(colour, dtype=float) - np.mean(colour)
    off = pixels - pixels.mean(axis=2, keepdims=True)
    strength = np.linalg.norm(off, axis=2)
    return (strength > 45.0) & (off @ own > 0.97 * strength * np.linalg.norm(own))


def differing(one: Pixels, other: Pixels) -> int:
    """How many pixels are clearly not the same."""
    return int((np.abs(one - other).max(axis=2) > 30).sum())


def is_other(than: Pixels, picture: Pixels) -> bool:
    """Whether a layer is gone: all of its lines."""
    return differing(than, picture) > 200


def middle(where: NDArray[np.bool_]) -> NDArray[np.float64]:
    return np.argwhere(where).mean(axis=0)


VIVID = [rgb(VEHICLES[k]) for k in (0, 1, 2, 3)]
"""Blue, amber, red, violet: those whose hue nothing else has."""


SHORT: dict[str, dict[str, Any]] = {"antipodal-8": {"cap_s": 6.0}, "escort": {"target": {"duration_s": 8.0}}}


@pytest.mark.parametrize("name", SHORT)
def test_pixels_show_vehicles_that_move_their_trails_and_their_plans(
    name: str, page: Callable[[str], Look], fly: Callable[[Scenario], Flying], tmp_path: Path
) -> None:
    changes: dict[str, Any] = {"airborne": True, "companion": {"rates": {"replan_us": 50_000}}}
    of = scenario(name, **{**changes, **SHORT[name]})
    flight = fly(of)
    look = page(flight.viewer.url)
    look.wait("flight", 2.0)
    look.hush()
    look.press("pause")
    first = look.wait("flight · paused")
    flight.show.released.set()
    look.settle()
    before = look.pixels(tmp_path / f"{name}-1.png")
    vivid = VIVID[: of.vehicles]
    for colour in vivid:
        assert near(before, colour).sum() > 25, colour
    # Paused means that nothing moves.
    assert differing(look.pixels(), before) < 50

    for _ in range(12):
        look.press("step")
    assert look.wait("flight · paused", first + 0.9) < first + 2.0
    look.settle()
    after = look.pixels(tmp_path / f"{name}-2.png")
    moved = [np.linalg.norm(middle(near(after, c)) - middle(near(before, c))) for c in vivid]
    assert np.median(moved) > 2.0
    assert differing(after, before) > 300

    look.page.get_by_text("Show", exact=True).click()
    look.settle()
    shown = look.pixels()
    # One after the other: with both off, neither is left.
    for layer in ("Trails", "Plans"):
        look.tick(layer)
        path = tmp_path / f"{name}-without-{layer}.png"
        assert look.until(partial(is_other, shown), path), layer
        shown = look.pixels()

    # Nobody but the server was asked, and nothing went wrong.
    hosts = {urlsplit(url).hostname for url in look.asked if not url.startswith(("blob:", "data:"))}
    assert hosts == {"localhost"}
    assert look.wrong == []
    look.page.close()

    # All of this, and the end of it, is nothing to the flight.
    flight.kill()
    flight.join()
    alone = tmp_path / "alone"
    alone.mkdir()
    swarm.fly(Prepared(of, FIREFLY), 1, alone, lambda _stage, _seconds: None)
    for path in ("flight.npz", *(f"vehicle-{system}.tlog" for system in of.systems)):
        assert logs(alone)[path] == logs(flight.directory)[path], path
