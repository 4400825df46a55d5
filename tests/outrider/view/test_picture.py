"""The picture's data: scenes, attitudes, planes, the table, and meshes."""

from __future__ import annotations

from math import cos, inf, nan, pi, sin
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.values.horizon import roll_out
from outrider.palette import VEHICLES, linear, rgb
from outrider.runs.surfaces import Surfaces
from outrider.scenarios.footprints import rectangles
from outrider.scene.airframe import HEXAROTOR, airframe
from outrider.scene.planes import MOST, between, facing
from outrider.scene.scene import Scene, staged
from outrider.scene.snapshot import KNOTS, Snapshot, State, euler_attitude, nearest, padded
from outrider.view import shapes
from outrider.view.camera import followed
from outrider.view.panel import struck, table
from tests.outrider.shipped import SCENARIOS, scenario

ANGLES = st.floats(-3.1, 3.1)
PITCH = st.floats(-1.5, 1.5)
VECTORS = st.tuples(*[st.floats(-20.0, 20.0)] * 3).map(np.array)


def matrix(q: np.ndarray) -> np.ndarray:
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


@given(ANGLES, PITCH, ANGLES)
def test_attitudes_point_where_the_angles_say(roll: float, pitch: float, yaw: float) -> None:
    """The nose of a FRD body in NED, given in ENU; and its right wing, which is minus FLU's y."""
    body = matrix(euler_attitude(roll, pitch, yaw))
    nose = (sin(yaw) * cos(pitch), cos(yaw) * cos(pitch), sin(pitch))
    np.testing.assert_allclose(body[:, 0], nose, atol=1e-9)
    # Level with the horizon's right, then rolled about the nose: its height is −sin(roll) cos(pitch).
    assert -body[2, 1] == pytest.approx(-sin(roll) * cos(pitch), abs=1e-9)


@pytest.mark.parametrize("name", sorted(SCENARIOS))
def test_every_shipped_scenario_has_a_scene(name: str) -> None:
    of = scenario(name)
    scene = staged(of, 1, airframe(of.vehicle), frozenset({"pace", "methods"}))
    assert scene.systems == tuple(of.systems)
    assert len(scene.solids) == len(of.obstacles)
    assert len(scene.movers) == len(of.moving)
    certified = of.companion.avoidance == "certified"
    assert (scene.step_s is not None) == certified == ("methods" not in scene.levers)
    assert scene.reach > 0.0


@given(st.lists(VECTORS, min_size=2, max_size=6))
def test_the_nearest_pair_is_the_nearest(places: list[np.ndarray]) -> None:
    position = np.array(places, np.float32)
    pair = nearest(position)
    every = [np.linalg.norm(position[j] - position[k]) for j in range(len(places)) for k in range(j)]
    assert pair.distance == pytest.approx(min(every), abs=1e-4)
    assert nearest(position[:1]).distance == inf
    position[0] = nan
    assert 0 not in (nearest(position).one, nearest(position).other) or len(places) == 2


@given(st.lists(st.tuples(VECTORS, VECTORS, VECTORS), min_size=2, max_size=5))
def test_planes_lie_between_the_plans_that_they_part(plans: list[tuple[np.ndarray, ...]]) -> None:
    step = 0.1
    horizons = [roll_out(0, 100_000, x, 0.2 * v, np.tile(0.2 * a, (15, 1))) for x, v, a in plans]
    plan = np.array([padded(one.knots[:, :6]) for one in horizons])
    found = between(plan, step)
    assert len(found.middle) <= MOST
    np.testing.assert_allclose(np.linalg.norm(found.normal, axis=1), 1.0, atol=1e-6)
    turned = facing(found.normal)
    for quaternion, normal in zip(turned, found.normal, strict=True):
        np.testing.assert_allclose(matrix(quaternion)[:, 2], normal, atol=1e-6)
    if len(plans) == 2 and len(found.gap) and found.gap[0] > 0.1:
        # In the middle of its segment one plan is on one side, the other on the other. At its ends both may
        # be on one side: plans that move along the normal take the plane with them.
        places = plan[..., :3].astype(float)
        side = (0.5 * (places[:, :-1] + places[:, 1:]) - found.middle[0]) @ found.normal[0]
        assert (side[0] * side[1] < 0.0).any()


def test_a_plan_of_any_length_fills_its_rows() -> None:
    assert np.isnan(padded(np.empty((0, 6)))).all()
    short = padded(np.arange(12.0).reshape(2, 6))
    assert short.shape == (KNOTS, 6)
    assert (short[2:] == short[1]).all()
    assert padded(np.zeros((40, 6))).shape == (KNOTS, 6)


@pytest.mark.parametrize(
    "mesh",
    [
        shapes.rotors(HEXAROTOR),
        shapes.frame(HEXAROTOR),
        shapes.blades(HEXAROTOR),
        shapes.nose(),
        shapes.ball(1.0),
        shapes.prism(8, 1.0, 2.0),
        shapes.cone(1.0, 0.2, 0.0),
        shapes.box((1.0, 2.0, 3.0)),
        shapes.around_box((1.0, 2.0, 3.0), 0.5, 3),
        shapes.around_box((0.2, 5.0, 1.0), 0.3, 1),
    ],
)
def test_meshes_are_closed_and_look_outwards(mesh: shapes.Mesh) -> None:
    a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    # The divergence theorem: a volume, and no leak.
    assert np.einsum("fi,fi->f", a, np.cross(b, c)).sum() > 0.0
    np.testing.assert_allclose(np.cross(b - a, c - a).sum(axis=0), 0.0, atol=1e-9)


@pytest.mark.parametrize("shape", [shapes.annulus(1.0, 0.1), shapes.tile()])
def test_flat_meshes_are_level(shape: shapes.Mesh) -> None:
    assert (shape.vertices[:, 2] == 0.0).all()
    assert shape.faces.max() < len(shape.vertices)


def test_colours_as_intensities() -> None:
    assert linear((0, 0, 0)).tolist() == [0, 0, 0]
    assert linear((255, 255, 255)).tolist() == [255, 255, 255]
    # Middle grey of sRGB is a fifth of the light.
    assert linear((118, 118, 118)).tolist() == [46, 46, 46]
    assert rgb(VEHICLES[0]) == (46, 143, 249)


@given(VECTORS, VECTORS, st.floats(-5.0, 5.0))
def test_a_click_strikes_its_level_in_front_of_the_eye(
    eye: np.ndarray, along: np.ndarray, height: float
) -> None:
    place = struck(tuple(eye), tuple(along), height)  # type: ignore[arg-type]
    if place is not None:
        assert place[2] == pytest.approx(height, abs=1e-6 * (1.0 + abs(eye[2])) + 1e-6)
        assert (place - eye) @ along >= 0.0


def test_the_picture_follows_smoothly_and_at_once_where_the_time_jumps() -> None:
    """A run that is paused and sought shows one snapshot only: it has to be in the picture."""
    focus, middle = np.zeros(3), np.array([40.0, -3.0, 5.0])
    for elapsed in (-15.0, 5.0):
        np.testing.assert_array_equal(followed(focus, middle, elapsed), middle)
    near = followed(focus, middle, 0.05)
    assert 0.0 < np.linalg.norm(near) < 0.5 * np.linalg.norm(middle)
    for _ in range(100):
        near = followed(near, middle, 0.05)
    np.testing.assert_allclose(near, middle, atol=1e-3)


def test_what_a_log_brings_in_stays_text() -> None:
    scene = Scene("mine", (11, 12), 2)
    state = State("<script>alert(1)</script>", 0.123, nan, None)
    moment = Snapshot(
        1.0,
        "run",
        np.zeros((2, 3), np.float32),
        np.zeros((2, 4), np.float32),
        np.zeros((2, KNOTS, 6), np.float32),
        np.zeros(3, np.float32),
        np.empty((0, 3), np.float32),
        (state, State()),
    )
    text = table(scene, moment)
    assert "<script>" not in text
    assert "&lt;script&gt;" in text
    assert "0.12" in text
    assert text.count("<tr>") == 3


def test_a_large_fleet_has_a_short_table() -> None:
    count = 200
    moment = Snapshot(
        0.0,
        "run",
        np.zeros((count, 3), np.float32),
        np.zeros((count, 4), np.float32),
        np.zeros((count, KNOTS, 6), np.float32),
        np.zeros(3, np.float32),
        np.empty((0, 3), np.float32),
        (State(),) * count,
    )
    text = table(Scene("many", tuple(range(1, count + 1)), count), moment)
    assert "and 136 more" in text


BOX: dict[str, Any] = {"kind": "box", "at": [4.0, -1.0, 2.0], "size": [2.0, 1.0, 3.0], "yaw_deg": 35.0}
WALL: dict[str, Any] = {"kind": "wall", "ends": [[-3.0, -4.0], [1.0, 3.0]], "thickness": 0.5, "height": 4.0}


def test_boxes_and_walls_lie_in_the_picture_where_they_stand() -> None:
    """The mesh is the surface, and the shell is the surface d_min away: all of it, and nothing else."""
    of = scenario("obstacles", obstacles=[BOX, WALL])
    scene = staged(of, 1, airframe(of.vehicle), frozenset())
    surfaces, d_min = Surfaces(of.obstacles), scene.d_min_solid
    for k, one in enumerate(scene.solids):
        itself = shapes.placed(shapes.box(one.size), one.at, one.yaw)
        shell = shapes.placed(shapes.around_box(one.size, d_min, 3), one.at, one.yaw)
        for mesh, distance in ((itself, 0.0), (shell, d_min)):
            apart = surfaces.distance(mesh.vertices[:, None], np.array([k]))
            np.testing.assert_allclose(apart, distance, atol=1e-9)
        corners = rectangles(of.obstacles)[k]
        low, high = one.at[2] - 0.5 * one.size[2], one.at[2] + 0.5 * one.size[2]
        expected = {(round(x, 6), round(y, 6), round(z, 6)) for x, y in corners for z in (low, high)}
        assert {tuple(np.round(place, 6)) for place in itself.vertices} == expected


def test_a_shell_of_a_box_holds_what_is_near_it() -> None:
    """Its volume is that of the box, of its sides' slabs, its edges' quarters and its corners' eighths."""
    size, d = (1.0, 2.0, 3.0), 0.5
    (x, y, z), mesh = size, shapes.around_box(size, d, 24)
    a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    volume = np.einsum("fi,fi->f", a, np.cross(b, c)).sum() / 6.0
    exact = x * y * z + 2 * d * (x * y + y * z + z * x) + pi * d**2 * (x + y + z) + 4 / 3 * pi * d**3
    assert volume == pytest.approx(exact, rel=2e-3)


@pytest.mark.parametrize(("vehicle", "marked"), [("point", True), ("firefly", False)])
def test_a_scene_of_points_is_marked_as_such(vehicle: str, marked: bool) -> None:
    of = scenario("antipodal-8").model_copy(update={"vehicle": vehicle})
    scene = staged(of, 1, airframe(of.vehicle), frozenset())
    assert ("points, no physics" in scene.title) is marked
