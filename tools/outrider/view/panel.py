"""Panel beside the scene: the table, the plot, the visible layers, and the settings that may be changed."""

from __future__ import annotations

from collections import deque
from html import escape
from math import isfinite

import numpy as np
import viser
from viser import uplot

from outrider.palette import BAD, VEHICLES, hex_of
from outrider.scenarios.options import METHODS
from outrider.scene.scene import Scene
from outrider.scene.snapshot import Snapshot, nearest
from outrider.scene.view_commands import ViewCommands
from outrider.view import camera
from outrider.view.renderer import Renderer

SPEEDS = ("0.1", "0.25", "0.5", "1", "2", "4", "8", "as fast as it can")
TABLE_EVERY, PLOT_EVERY = 0.2, 0.5
"""Update periods of the table and of the plot (s of wall time)."""
POINTS = 600
"""Points of the plot; at twice as many, every other one is removed."""
_MOST_ROWS = 64


class Panel:
    """Panel for ``stage`` on ``server``.

    ``begin`` holds the initial view commands and ``commands`` the current ones. ``sought`` is the time (s)
    chosen at the slider; the loop that plays a run takes it.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        stage: Renderer,
        begin: ViewCommands,
        span: tuple[float, float] | None = None,
        hint: str = "",
    ) -> None:
        self._server, self._stage, self._gui = server, stage, server.gui
        self.commands = self._begin = begin
        self._watched = False
        self._last: Snapshot | None = None
        self._speed: viser.GuiDropdownHandle[str] | None = None
        self.sought: float | None = None
        self._series: deque[tuple[float, float]] = deque()
        self._next_table = self._next_plot = 0.0
        gui, scene = server.gui, stage.scene
        gui.set_panel_label(scene.title)
        gui.configure_theme(
            control_width="medium", show_logo=False, show_share_button=False, brand_color=(31, 95, 174)
        )
        gui.main_panel.dock_right()
        self._head = gui.add_markdown("")
        self._slider: viser.GuiSliderHandle[float] | None = None
        if "pace" in scene.levers:
            self._add_pace(span)
        if scene.levers & {"methods", "loss", "target"}:
            self._add_changes(scene)
        self._add_cameras()
        self._table = gui.add_html("")
        self._plot = gui.add_uplot(
            (np.zeros(1), np.zeros(1), np.zeros(1)),
            (
                uplot.Series(label="s"),
                uplot.Series(label="nearest pair, m", stroke=VEHICLES[0], width=2),
                uplot.Series(label="d_min, m", stroke="#{:02x}{:02x}{:02x}".format(*BAD), width=1),
            ),
            scales={"x": uplot.Scale(time=False, auto=True), "y": uplot.Scale(auto=True)},
            height=190,
        )
        self._add_layers()
        if hint:
            gui.add_markdown(hint)

    def watch(self, watched: bool) -> None:
        """Set whether any browser shows the page.

        A flight whose initial speed is unlimited is set to real time when the first browser appears. When no
        browser is left that could resume a flight, it is resumed at its initial speed.
        """
        if self._speed is None or watched == self._watched:
            return
        self._watched = watched
        if watched and self._begin.speed is None:
            self._speed.value = "1"  # type: ignore[misc]
            self.commands = self.commands._replace(speed=1.0)
        elif not watched:
            self.commands = self.commands._replace(speed=self._begin.speed, paused=False)

    def see(self, moment: Snapshot) -> None:
        """Add a point to the plot. A time before the last one clears the plot."""
        if self._series and moment.time < self._series[-1][0]:
            self._series.clear()
        distance = moment.least_distance()
        if isfinite(distance):
            # The plot has no range with a value that is not finite.
            self._series.append((moment.time, distance))
        if len(self._series) > 2 * POINTS:
            self._series = deque(list(self._series)[::2])

    def show(self, moment: Snapshot, wall: float, playing: float | None = None) -> None:
        """Show the table and the plot of ``moment``, if they are due at ``wall`` (s).

        ``playing`` is the position of the slider, or None.
        """
        if wall >= self._next_table:
            self._next_table = wall + TABLE_EVERY
            self._last = moment
            self.head()
            self._table.content = table(self._stage.scene, moment)
            if self._slider is not None and playing is not None:
                self._slider.value = playing  # type: ignore[misc]
        if wall >= self._next_plot and self._series:
            self._next_plot = wall + PLOT_EVERY
            time, distance = np.array(self._series).T
            d_min = self._stage.scene.d_min
            self._plot.data = (time, distance, np.full(len(time), np.nan if d_min is None else d_min))

    def head(self) -> None:
        """Update the headline from the last snapshot shown and the current view commands."""
        if self._last is not None:
            self._head.content = self._headline(self._last)

    def _headline(self, moment: Snapshot) -> str:
        pair, scene = nearest(moment.position), self._stage.scene
        near = ""
        if isfinite(distance := moment.least_distance()) and isfinite(pair.distance):
            near = f" · nearest {distance:.2f} m ({scene.systems[pair.one]}–{scene.systems[pair.other]})"
        paused = " · paused" if self.commands.paused and "pace" in scene.levers else ""
        return f"**{moment.time:.1f} s** · {moment.stage}{paused}{near}"

    def _add_pace(self, span: tuple[float, float] | None) -> None:
        gui = self._gui
        pause = gui.add_button_group("Time", ("pause", "play", "step"))
        now = self.commands.speed
        first = SPEEDS[-1] if now is None else f"{now:g}"
        self._speed = speed = gui.add_dropdown("Speed", SPEEDS, initial_value=first)

        @pause.on_click
        def _(_event: object) -> None:
            if pause.value == "step":
                self.commands = self.commands._replace(paused=True, steps=self.commands.steps + 1)
            else:
                self.commands = self.commands._replace(paused=pause.value == "pause")

        @speed.on_update
        def _(_event: object) -> None:
            value = None if speed.value == SPEEDS[-1] else float(speed.value)
            self.commands = self.commands._replace(speed=value)

        if span is not None:
            self._slider = slider = gui.add_slider("At, s", *span, 0.02, span[0])

            @slider.on_update
            def _(event: viser.GuiEvent[viser.GuiSliderHandle[float]]) -> None:
                if event.client is not None:
                    self.sought = float(slider.value)

        # Letters and digits are all that viser's types know; its page compares any name of a key.
        space = gui.add_command("Play or pause", hotkey="space")

        @space.on_trigger
        def _(_event: object) -> None:
            self.commands = self.commands._replace(paused=not self.commands.paused)

    def _add_cameras(self) -> None:
        """Add what moves the camera of the browser that asks, and what follows the vehicles."""
        gui, stage = self._gui, self._stage
        views = gui.add_button_group("Camera", ("fit", "top"))
        follow = gui.add_checkbox("Follow the vehicles", stage.follows)
        whole, top = gui.add_command("Fit", hotkey="0"), gui.add_command("From above", hotkey="T")

        def aim(client: viser.ClientHandle | None, name: str) -> None:
            if client is not None:
                to = camera.above if name == "top" else camera.whole
                to(client.camera, stage.scene.reach, client.camera.aspect)

        @views.on_click
        def _(event: viser.GuiEvent[viser.GuiButtonGroupHandle]) -> None:
            aim(event.client, views.value)

        @follow.on_update
        def _(_event: object) -> None:
            stage.follows = follow.value

        @whole.on_trigger
        def _(event: viser.CommandEvent) -> None:
            aim(event.client, "fit")

        @top.on_trigger
        def _(event: viser.CommandEvent) -> None:
            aim(event.client, "top")

    def _add_changes(self, scene: Scene) -> None:
        gui = self._gui
        with gui.add_folder("Change"):
            if "methods" in scene.levers:
                ways = tuple(dict.fromkeys((scene.methods, *METHODS)))
                method = gui.add_dropdown("Method", ways, initial_value=scene.methods)

                @method.on_update
                def _(_event: object) -> None:
                    self.commands = self.commands._replace(methods=method.value)

            if "loss" in scene.levers:
                loss = gui.add_slider("Loss, %", 0.0, 100.0, 1.0, round(100.0 * scene.loss))

                @loss.on_update
                def _(_event: object) -> None:
                    self.commands = self.commands._replace(loss=loss.value / 100.0)

            if "target" in scene.levers:
                clicks = gui.add_checkbox("A click moves the target", False)
                self._add_clicks(clicks)

    def _add_clicks(self, clicks: viser.GuiCheckboxHandle) -> None:
        self._height = 0.0

        @clicks.on_update
        def _(_event: object) -> None:
            if clicks.value:
                self._server.scene.on_click()(self._click)
            else:
                self._server.scene.remove_click_callback()

    def _click(self, event: viser.SceneClickEvent) -> None:
        place = struck(event.ray_origin, event.ray_direction, self._target_height - self._stage.focus[2])
        if place is not None:
            x, y, z = (place + self._stage.focus).tolist()
            self.commands = self.commands._replace(target=(x, y, z), moves=self.commands.moves + 1)

    _target_height = 0.0

    def notice(self, moment: Snapshot) -> None:
        """Store the height of the target, which a click does not change."""
        if np.isfinite(moment.target).all():
            self._target_height = float(moment.target[2])

    def _add_layers(self) -> None:
        gui, scene = self._gui, self._stage.scene
        known = {"trails": "Trails", "plans": "Plans", "labels": "Labels", "views": "Cameras"}
        if scene.d_min is not None:
            known["shells"] = "d_min: shells that touch"
        if scene.d_safe is not None:
            known["reach"] = "d_safe: rings that touch"
        if scene.step_s is not None:
            known["planes"] = "Separating planes"
        with gui.add_folder("Show", expand_by_default=False):
            cell, section = self._stage.cell, self._stage.section
            gui.add_markdown(f"Lines on the ground: {cell:g} m apart, thick ones {section:g} m.")
            for name, label in known.items():
                self._add_layer(name, label)

    def _add_layer(self, name: str, label: str) -> None:
        box = self._gui.add_checkbox(label, getattr(self._stage.layers, name))

        @box.on_update
        def _(_event: object) -> None:
            self._stage.layers = self._stage.layers._replace(**{name: box.value})


def struck(
    origin: tuple[float, float, float], direction: tuple[float, float, float], height: float
) -> np.ndarray | None:
    """Return the point (3,) where a ray meets the horizontal plane at ``height``; None if it does not."""
    begin, along = np.array(origin), np.array(direction)
    if abs(along[2]) < 1e-6 or (share := (height - begin[2]) / along[2]) <= 0.0:
        return None
    place: np.ndarray = begin + share * along
    return place


def table(scene: Scene, moment: Snapshot) -> str:
    """Return the HTML table with a row for each vehicle."""
    rows = []
    for k, (system, state) in enumerate(zip(scene.systems, moment.states, strict=True)):
        if k == _MOST_ROWS:
            rows.append(f'<tr><td colspan="5">and {len(scene.systems) - k} more</td></tr>')
            break
        colour = hex_of(k, scene.tasked)
        held = "–" if state.held is None else str(state.held)
        rows.append(
            f'<tr><td style="white-space:nowrap"><span style="color:{colour}">&#9679;</span> {system}</td>'
            f"<td>{escape(state.mode) or '–'}</td><td>{_figure(state.age_s, 2)}</td>"
            f"<td>{_figure(state.plan_ms, 2)}</td><td>{held}</td></tr>"
        )
    head = "".join(f'<th style="text-align:left;font-weight:600">{name}</th>' for name in _HEADS)
    style = "width:100%;font-size:12px;line-height:1.45;font-variant-numeric:tabular-nums;padding:0 0.75em"
    return f'<table id="vehicles" style="{style}"><tr>{head}</tr>{"".join(rows)}</table>'


_HEADS = ("id", "does", "age, s", "plan, ms", "held")


def _figure(value: float, digits: int) -> str:
    return f"{value:.{digits}f}" if isfinite(value) else "–"
