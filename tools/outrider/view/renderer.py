"""Renderer of the scene in the browser: the scene is built once, then only the moving parts are updated."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import viser
from numpy.typing import NDArray

from outrider.palette import ACCENT, GRID, RGB, SOFT, SOLID, TARGET, colours, linear, rgb
from outrider.scene.camera_view import field_lines, rays
from outrider.scene.planes import MOST, Plane, between, facing
from outrider.scene.scene import Scene, Solid
from outrider.scene.snapshot import Array, Single, Snapshot
from outrider.view import camera, shapes
from outrider.view.bodies import AWAY, IDENTITY, Bodies
from outrider.view.trails import Trails

WORLD = "/world"
_MAX_SIZE_FACTOR, _SIZE_SHARE = 3.0, 0.09
"""Limits of the drawn size of a vehicle.

It is the larger of the vehicle's span and the second value times the scene's reach, but at most the first
value times the span.
"""
_VIEW_SHARE = 0.18
"""Length of a drawn field of view, as a share of the scene's reach."""
_TARGET = rgb(TARGET)
_SCALE_LABELS = 2
"""Number of labelled distances in each direction from the middle of the ground."""
_MAX_ROUND_SHELLS = 300
"""Number of boxes up to which their shells are drawn like others."""
_NO_LINE = np.zeros((1, 2, 3))


class Layers(NamedTuple):
    """Visibility of the layers."""

    trails: bool = True
    plans: bool = True
    shells: bool = True
    reach: bool = False
    planes: bool = True
    labels: bool = True
    views: bool = True


class Renderer:
    """``scene`` on ``server``.

    All bodies are below one frame, which moves against the vehicles while ``follows``: at first, if the scene
    requests that.
    """

    def __init__(self, server: viser.ViserServer, scene: Scene) -> None:
        self._stage, self.scene = server.scene, scene
        stage, count = server.scene, len(scene.systems)
        self._painted = colours(count, scene.tasked)
        self._colours = linear(self._painted)
        self._focus = np.array(scene.centre)
        self._shown: float | None = None
        self._layers = Layers()
        stage.set_up_direction("+z")
        stage.configure_default_lights(cast_shadow=False)
        stage.world_axes.visible = False
        self._world = stage.add_frame(WORLD, show_axes=False, position=-self._focus)
        self.size = _drawn(scene)
        self._ground()
        self._stand()
        self._target = self._around_the_target()
        self._movers = [self._solid(f"mover-{j}", mover) for j, mover in enumerate(scene.movers)]
        self._bodies = Bodies(stage, WORLD, scene.airframe, self.size, self._colours)
        self._shells = self._many(
            "shells", shapes.ball(0.5 * (scene.d_min or 0.0)), self._colours, 1.0, opacity=0.18
        )
        width = 0.004 * scene.reach
        ring = shapes.annulus(0.5 * (scene.d_safe or 1.0), width)
        self._reach = self._many("reach", ring, self._colours, 1.0, opacity=0.55, side="double")
        self._planes = stage.add_batched_meshes_simple(
            f"{WORLD}/planes",
            *shapes.tile(),
            batched_wxyzs=np.tile(IDENTITY, (MOST, 1)),
            batched_positions=np.tile(AWAY, (MOST, 1)),
            batched_scales=np.full(MOST, 0.15 * scene.reach),
            batched_colors=linear(ACCENT),
            opacity=0.2,
            side="double",
            cast_shadow=False,
            receive_shadow=False,
        )
        self._plans = stage.add_line_segments(
            f"{WORLD}/plans", _NO_LINE, _NO_LINE.astype(np.uint8), thickness=3.0, thickness_units="screen"
        )
        self._drops = stage.add_line_segments(
            f"{WORLD}/drops", _NO_LINE, SOLID, thickness=1.0, thickness_units="screen"
        )
        self._views = stage.add_line_segments(
            f"{WORLD}/views", _NO_LINE, _NO_LINE.astype(np.uint8), thickness=1.2, thickness_units="screen"
        )
        self._rays = stage.add_line_segments(
            f"{WORLD}/rays", _NO_LINE, _NO_LINE.astype(np.uint8), thickness=2.0, thickness_units="screen"
        )
        self._trails = Trails(stage, f"{WORLD}/trails", self._colours, 2.0)
        self._labels = [
            stage.add_label(
                f"{WORLD}/label-{system}",
                str(system),
                font_screen_scale=0.9 if count <= 16 else 0.6,
                anchor="bottom-center",
                position=AWAY,
            )
            for system in scene.systems
        ]
        self.follows = scene.follows
        camera.whole(server.initial_camera, scene.reach)
        self.layers = Layers()

    @property
    def focus(self) -> Array:
        """Point (3,) in the middle of the picture, fleet-local ENU."""
        return self._focus.copy()

    @property
    def cell(self) -> float:
        """Distance (m) between two thin lines of the ground."""
        return shapes.ground_lines(self.scene.reach)[0]

    @property
    def section(self) -> float:
        """Distance (m) between two thick lines of the ground, which have labels."""
        return shapes.ground_lines(self.scene.reach)[1]

    @property
    def layers(self) -> Layers:
        """Visible layers."""
        return self._layers

    @layers.setter
    def layers(self, layers: Layers) -> None:
        self._layers, scene = layers, self.scene
        self._trails.show(layers.trails)
        self._plans.visible = layers.plans
        self._shells.visible = layers.shells and scene.d_min is not None
        self._views.visible = self._rays.visible = layers.views
        self._reach.visible = layers.reach and scene.d_safe is not None
        self._planes.visible = layers.planes and scene.step_s is not None
        for label in self._labels:
            label.visible = layers.labels

    def show(self, moment: Snapshot, past: tuple[Snapshot, ...] = ()) -> None:
        """Show a snapshot; ``past`` holds earlier snapshots for the trails."""
        for one in (*past, moment):
            self._trails.see(one.time, one.position)
        there = np.asarray(np.isfinite(moment.position).all(axis=1))
        place = np.where(there[:, None], moment.position, AWAY).astype(np.float32)
        attitude = np.where(np.isfinite(moment.attitude), moment.attitude, IDENTITY).astype(np.float32)
        self._bodies.show(moment.time, place, attitude)
        for handle in (self._shells, self._reach):
            handle.batched_positions = place
        for label, at in zip(self._labels, place.tolist(), strict=True):
            label.position = (at[0], at[1], at[2] + 0.45 * self.size)
        self._draw_plans(moment)
        if len(moment.views):
            self._draw_views(moment)
        ground = moment.position[there] * np.array((1.0, 1.0, 0.0), np.float32)
        self._drops.points = np.stack([moment.position[there], ground], axis=1)
        self._target.visible = bool(np.isfinite(moment.target).all())
        if self._target.visible:
            self._target.position = moment.target
        for mover, at in zip(self._movers, moment.moving, strict=False):
            mover.visible = bool(np.isfinite(at).all())
            if mover.visible:
                mover.position = at
        elapsed = 0.0 if self._shown is None else moment.time - self._shown
        self._shown = moment.time
        if self.follows and there.any():
            self._focus = camera.followed(self._focus, moment.position[there].mean(axis=0), elapsed)
            self._world.position = -self._focus

    def _draw_plans(self, moment: Snapshot) -> None:
        ways = moment.plan[..., :3]
        points = np.stack([ways[:, :-1], ways[:, 1:]], axis=2)
        there = np.isfinite(points).all(axis=(2, 3))
        paint = np.broadcast_to(self._colours[:, None, None], points.shape)
        self._plans.colors = np.ascontiguousarray(paint[there])
        self._plans.points = points[there]
        if self.scene.step_s is None or not self._layers.planes:
            return
        known = np.isfinite(moment.plan).all(axis=(1, 2))
        found = between(moment.plan[known], self.scene.step_s)
        self._planes.batched_positions, self._planes.batched_wxyzs = _pool(found)

    def _draw_views(self, moment: Snapshot) -> None:
        """Draw the fields of view of cameras, and rays to what they detect."""
        fields = field_lines(moment.views, _VIEW_SHARE * self.scene.reach)
        for handle, lines in (
            (self._views, fields),
            (self._rays, rays(moment.views, moment.position)[:, None]),
        ):
            there = np.isfinite(lines).all(axis=(2, 3))
            paint = np.broadcast_to(self._colours[:, None, None], lines.shape)
            handle.colors = np.ascontiguousarray(paint[there])
            handle.points = lines[there]

    def _many(
        self, name: str, mesh: shapes.Mesh, paint: NDArray[np.uint8], scale: float, **more: object
    ) -> viser.BatchedMeshHandle:
        """Add one mesh for each vehicle."""
        count = len(self.scene.systems)
        return self._stage.add_batched_meshes_simple(
            f"{WORLD}/{name}",
            *mesh,
            batched_wxyzs=np.tile(IDENTITY, (count, 1)),
            batched_positions=np.tile(AWAY, (count, 1)),
            batched_scales=np.full(count, scale),
            batched_colors=paint,
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
            **more,  # type: ignore[arg-type]
        )

    def _ground(self) -> None:
        """Add a grid with its scale: distances from the fleet's origin to the east and to the north."""
        cell = self.cell
        self._stage.add_grid(
            f"{WORLD}/ground",
            infinite_grid=True,
            cell_size=cell,
            section_size=self.section,
            cell_color=GRID,
            section_color=GRID,
            cell_thickness=0.4,
            section_thickness=0.8,
            fade_distance=14.0 * self.scene.reach,
            shadow_opacity=0.0,
        )
        for n in (k for k in range(-_SCALE_LABELS, _SCALE_LABELS + 1) if k):
            away = self.section * n
            for axis, place in (("E", (away, 0.0, 0.0)), ("N", (0.0, away, 0.0))):
                self._stage.add_label(
                    f"{WORLD}/scale-{axis}{n}",
                    f"{away:g} m {axis}",
                    font_screen_scale=0.6,
                    anchor="top-left",
                    position=place,
                )

    def _stand(self) -> None:
        """Add what never moves: goals and obstacles."""
        scene = self.scene
        for k, goal in enumerate(scene.goals):
            mark = shapes.annulus(0.35 * self.size, 0.06 * self.size)
            self._stage.add_mesh_simple(
                f"{WORLD}/goal-{k}",
                *mark,
                color=self._painted[k],
                side="double",
                position=goal,
                cast_shadow=False,
            )
        boxes = [solid for solid in scene.solids if solid.kind == "box"]
        if boxes:
            self._boxes(boxes)
        for j, solid in enumerate(scene.solids):
            if solid.kind != "box":
                handle = self._solid(f"solid-{j}", solid)
                handle.position = solid.at

    def _boxes(self, boxes: list[Solid]) -> None:
        """Add all boxes as one mesh, and their shells as another: a browser draws thousands of them so."""
        # Of many shells behind each other each is fainter, and its edges are bevelled.
        steps, faint = (3, 0.15) if len(boxes) <= _MAX_ROUND_SHELLS else (1, 0.05)
        distance = self.scene.d_min_solid
        for name, opacity, meshes in (
            ("itself", None, [shapes.box(one.size) for one in boxes]),
            ("shell", faint, [shapes.around_box(one.size, distance, steps) for one in boxes]),
        ):
            there = [shapes.placed(mesh, one.at, one.yaw) for mesh, one in zip(meshes, boxes, strict=True)]
            self._stage.add_mesh_simple(
                f"{WORLD}/boxes-{name}",
                *shapes.joined(*there),
                color=SOLID,
                opacity=opacity,
                cast_shadow=False,
            )

    def _solid(self, name: str, solid: Solid) -> viser.FrameHandle:
        """Add a frame with the obstacle's shape, and the shell that no vehicle's centre may enter."""
        frame = self._stage.add_frame(f"{WORLD}/{name}", show_axes=False)
        shells: tuple[tuple[str, float, RGB, float | None], ...] = (
            ("itself", solid.radius, SOLID, None),
            ("shell", solid.radius + self.scene.d_min_solid, SOLID, 0.15),
        )
        for part, radius, color, opacity in shells:
            if solid.kind == "post":
                mesh = shapes.prism(32, radius, solid.height, (0.0, 0.0, 0.5 * solid.height))
            else:
                mesh = shapes.ball(radius)
            self._stage.add_mesh_simple(
                f"{WORLD}/{name}/{part}", *mesh, color=color, opacity=opacity, cast_shadow=False
            )
        return frame

    def _around_the_target(self) -> viser.FrameHandle:
        """Add the target, its shell and the formation surfaces, in a frame that moves with the target."""
        stage, scene, name = self._stage, self.scene, f"{WORLD}/target"
        frame = stage.add_frame(name, show_axes=False, visible=False)
        stage.add_icosphere(f"{name}/itself", 0.3 * self.size, color=_TARGET, cast_shadow=False)
        stage.add_label(
            f"{name}/label",
            "target",
            font_screen_scale=0.9,
            anchor="bottom-center",
            position=(0.0, 0.0, 0.4 * self.size),
        )
        if scene.d_min_target is not None:
            stage.add_icosphere(
                f"{name}/shell", scene.d_min_target, color=_TARGET, opacity=0.08, cast_shadow=False
            )
        for j, line in enumerate(scene.surfaces):
            closed = np.vstack([line, line[:1]])
            stage.add_line_segments(
                f"{name}/surface-{j}",
                np.stack([closed[:-1], closed[1:]], axis=1),
                SOFT,
                thickness=1.6,
                thickness_units="screen",
            )
        return frame


def _drawn(scene: Scene) -> float:
    """Return the size (m) at which a vehicle is drawn."""
    return float(
        min(max(scene.airframe.span, _SIZE_SHARE * scene.reach), _MAX_SIZE_FACTOR * scene.airframe.span)
    )


def _pool(found: Plane) -> tuple[Single, Single]:
    """Return positions (MOST, 3) and attitudes (MOST, 4) of the planes; unused planes are far away."""
    place = np.tile(np.array(AWAY, np.float32), (MOST, 1))
    turned = np.tile(np.array(IDENTITY, np.float32), (MOST, 1))
    count = len(found.middle)
    place[:count], turned[:count] = found.middle, facing(found.normal)
    return place, turned
